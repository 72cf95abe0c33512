"""The likeliest floor of a height, and how likely it is."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from dropanchor_schemas.plans import Floor
from dropanchor_service.estimation.columns import POSE, Array, HeightSource
from dropanchor_service.estimation.heights import p_between
from dropanchor_service.store.floors import NO_FLOORS, floors_of

HOUSE = floors_of(
    [
        Floor(name="1st", bottom_m=3.0, top_m=6.0),
        Floor(name="Ground", bottom_m=0.0, top_m=3.0),
        None,  # a plan of all floors
        Floor(name="Ground", bottom_m=2.0, top_m=3.0),  # another plan of the same floor
    ]
)


def poses(z: float, std: float, source: HeightSource = HeightSource.PRESSURE) -> Array:
    made = np.zeros(1, POSE)
    made["z"], made["z_std"], made["z_source"] = z, std, source
    return made


def floor(z: float, std: float, source: HeightSource = HeightSource.PRESSURE) -> tuple[str | None, float]:
    (number,), (probability,) = HOUSE.likeliest(poses(z, std, source))
    return (HOUSE.names[number] if number >= 0 else None), probability


@pytest.mark.parametrize(("z", "std"), [(1.2, 0.3), (2.9, 0.3), (3.1, 0.3), (4.5, 2.0), (2.5, 0.6)])
def test_the_probability_is_that_of_a_gaussian_between_the_ends_of_the_floor(z: float, std: float) -> None:
    ends = {"Ground": (0.0, 3.0), "1st": (3.0, 6.0)}
    expected = {name: norm.cdf(top, z, std) - norm.cdf(bottom, z, std) for name, (bottom, top) in ends.items()}
    name, probability = floor(z, std)
    assert name == max(expected, key=lambda one: expected[one])
    assert probability == pytest.approx(expected[str(name)], abs=1e-9)


@pytest.mark.parametrize(
    ("z", "std", "source"),
    [
        (9.0, 0.3, HeightSource.PRESSURE),  # above the house
        (3.0, 10.0, HeightSource.UNKNOWN),  # more likely on none
        (math.nan, math.nan, HeightSource.TOLD),
        (1.0, 0.15, HeightSource.START),  # nobody told the height of the start
    ],
    ids=["elsewhere", "wide", "unknown", "untold"],
)
def test_no_floor_is_named_where_none_is_likely(z: float, std: float, source: HeightSource) -> None:
    name, probability = floor(z, std, source)
    assert (name, math.isnan(probability)) == (None, True)


def test_looking_for_a_floor_leaves_the_pose_as_it_is() -> None:
    one = poses(1.0, 0.15, HeightSource.START)
    HOUSE.likeliest(one)
    assert one["z"].tolist() == [1.0]


def test_a_told_height_has_a_floor_and_an_exact_one_belongs_to_the_floor_above() -> None:
    assert floor(1.2, 0.15, HeightSource.TOLD)[0] == "Ground"
    assert floor(0.0, 0.0, HeightSource.TOLD)[0] == "Ground"
    assert floor(3.0, 0.0) == ("1st", 1.0)


def test_floors_stand_from_the_lowest_and_plans_of_the_same_one_count_once() -> None:
    assert (list(HOUSE.names), HOUSE.bottom.tolist(), HOUSE.top.tolist()) == (["Ground", "1st"], [0, 3], [3, 6])
    split = floors_of([Floor(name="A", bottom_m=0, top_m=1), Floor(name="A", bottom_m=5, top_m=6)])
    assert (list(split.names), split.number.tolist()) == (["A"], [0, 0])
    assert NO_FLOORS.likeliest(poses(1.0, 0.1))[0].tolist() == [-1]


def test_an_open_end_is_no_end() -> None:
    assert p_between(2.0, 0.5, -math.inf, 2.0) == pytest.approx(0.5)
    assert p_between(2.0, 0.5, -math.inf, math.inf) == 1.0
