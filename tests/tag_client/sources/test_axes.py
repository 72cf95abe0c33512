"""How an IMU is mounted, and what gravity says of it."""

from itertools import product

import pytest

from dropanchor_tag_client.sources.axes import AXES, UpAxis, direction, mounting

MOUNTINGS = [(f, u) for f, u in product(AXES, AXES) if f[-1] != u[-1]]


@pytest.mark.parametrize(("forward", "up"), MOUNTINGS)
def test_the_named_axes_become_forward_and_up_in_a_right_handed_frame(forward: str, up: str) -> None:
    mounted = mounting(forward, up)
    assert mounted.to_body(direction(forward)) == (1, 0, 0)
    assert mounted.to_body(direction(up)) == (0, 0, 1)
    x, y, z = zip(*mounted, strict=True)
    assert (
        x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) + x[2] * (y[0] * z[1] - y[1] * z[0])
        == 1
    )


@pytest.mark.parametrize("up", ["x", "-x"])
def test_forward_and_up_along_one_axis_are_refused(up: str) -> None:
    with pytest.raises(ValueError, match="must be different axes"):
        mounting("x", up)


@pytest.mark.parametrize("axis", AXES)
def test_gravity_says_once_per_fifty_samples_which_axis_points_up(axis: str) -> None:
    x, y, z = (9.7 * part + 0.2 for part in direction(axis))
    finder = UpAxis()
    assert [finder.add((x, y, z)) for _ in range(50)] == [None] * 49 + [axis]


@pytest.mark.parametrize("acc", [(5.0, 5.0, 6.7), (0.0, 0.0, 14.0), (0.0, 0.0, 0.0)])
def test_a_tilted_or_moving_imu_says_nothing(acc: tuple[float, float, float]) -> None:
    finder = UpAxis()
    assert {finder.add(acc) for _ in range(200)} == {None}
