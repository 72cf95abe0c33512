"""Readings of a phone's sensors become IMU samples in the axes of a tag."""

from collections.abc import Mapping

import pytest

from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.sources.phones.pairing import Pairing, Signs
from dropanchor_tag_client.sources.phones.problems import APART, TILTED
from dropanchor_tag_client.sources.phones.streams import Stream, make_stream
from support.sensor_logger import T_NS, G

MS = 1_000_000


def stream(times_ms: list[float], *values: tuple[float, float, float]) -> Stream:
    rows = values if len(values) == len(times_ms) else [values[0]] * len(times_ms)
    return make_stream((T_NS + round(t * MS), row) for t, row in zip(times_ms, rows, strict=True))


def paired(pairing: Pairing, batch: Mapping[str, Stream]) -> list[tuple[float, ImuSample]]:
    return [((sample.t_ns - T_NS) / MS, sample) for sample in pairing.add(batch).samples]


def test_a_sample_has_the_time_of_the_gyroscope_and_the_other_sensors_are_interpolated_there() -> None:
    batch = {
        "gyroscope": stream([10, 20], (0.1, 0.2, 0.3)),
        "totalacceleration": stream([5, 15, 25], (0, 0, 8), (0, 0, 10), (4, 0, 10)),
        "magnetometer": stream([0, 40], (20, 0, -40), (20, 8, -40)),
    }
    [(first, a), (second, b)] = paired(Pairing(Signs.AUTO), batch)
    assert (first, second) == (10, 20)
    assert a.acc == pytest.approx((0, 0, 9))
    assert b.acc == pytest.approx((0, -2, 10))
    assert a.mag == pytest.approx((2, -20, -40))


def test_the_top_edge_of_the_phone_is_forward_and_its_left_edge_left() -> None:
    batch = {
        "gyroscope": stream([10], (1, 2, 3)),
        "totalacceleration": stream([10], (4, 5, 6)),
        "magnetometer": stream([10], (7, 8, 9)),
    }
    [(_, sample)] = paired(Pairing(Signs.AUTO), batch)
    assert (sample.gyro, sample.acc, sample.mag) == ((2, -1, 3), (5, -4, 6), (8, -7, 9))


def test_what_lacks_its_neighbour_is_carried_to_the_next_batch() -> None:
    pairing = Pairing(Signs.AUTO)
    first = {"gyroscope": stream([10, 20], (0, 0, 1)), "totalacceleration": stream([5, 15], (0, 0, G))}
    assert [t for t, _ in paired(pairing, first)] == [10]
    second = {"gyroscope": stream([30], (0, 0, 1)), "totalacceleration": stream([25], (0, 0, G))}
    assert [t for t, _ in paired(pairing, second)] == [20]
    assert [t for t, _ in paired(pairing, {"totalacceleration": stream([35], (0, 0, G))})] == [30]


def linear_and_gravity(sign: float) -> dict[str, Stream]:
    """Screen up, pushed to the right with 1 m/s² and to the top with 2 m/s²; the two sensors' times differ."""
    return {
        "gyroscope": stream([10, 20], (0, 0, 0.5)),
        "accelerometer": stream([5, 25], (sign * 1, sign * 2, 0)),
        "gravity": stream([7, 27], (0, 0, sign * G)),
    }


@pytest.mark.parametrize(("sign", "signs"), [(1, "auto"), (-1, "auto"), (1, "android"), (-1, "ios")])
def test_linear_acceleration_and_gravity_make_specific_force_whichever_way_they_point(sign: float, signs: str) -> None:
    samples = paired(Pairing(Signs(signs)), linear_and_gravity(sign))
    assert len(samples) == 2
    for _, sample in samples:
        assert sample.acc == pytest.approx((2, -1, G))
        assert sample.gyro == (0, 0, 0.5)


def test_total_acceleration_is_androids_even_where_the_phone_lies_on_its_screen() -> None:
    pairing = Pairing(Signs.AUTO)
    upside_down = {
        "gravity": stream([0, 30], (0, 0, -G)),
        "accelerometer": stream([0, 30], (0, 0, 0)),
        "totalacceleration": stream([0, 30], (0, 0, -G)),
        "gyroscope": stream([10], (0, 0, 0)),
    }
    [(_, sample)] = paired(pairing, upside_down)
    assert sample.acc == pytest.approx((0, 0, -G))


def test_a_phone_whose_signs_cannot_be_told_is_asked_to_lie_flat_and_then_works() -> None:
    pairing = Pairing(Signs.AUTO)
    upright = linear_and_gravity(-1) | {"gravity": stream([7, 27], (0, -G, 0))}
    result = pairing.add(upright)
    assert (result.samples, result.problem) == ([], TILTED)
    flat = {name: Stream([t_ns + 100 * MS for t_ns in s.t_ns], s.values) for name, s in linear_and_gravity(-1).items()}
    result = pairing.add(flat)
    assert [sample.acc for sample in result.samples] == [pytest.approx((2, -1, G))] * 2
    assert result.problem == ""


@pytest.mark.parametrize(
    ("sensors", "sentence"),
    [
        (["totalacceleration"], "switch on Gyroscope."),
        (["gravity", "gyroscope"], "switch on Accelerometer."),
        (["accelerometer", "gyroscope"], "switch on Gravity."),
        (["gyroscope"], "switch on Total Acceleration (Android) or Accelerometer and Gravity (iPhone)."),
        ([], "switch on Gyroscope, and Total Acceleration (Android) or Accelerometer and Gravity (iPhone)."),
    ],
)
def test_a_phone_is_told_which_sensors_to_switch_on_once_it_is_sure(sensors: list[str], sentence: str) -> None:
    pairing = Pairing(Signs.IOS)
    problems = [pairing.add({name: stream([t], (0, 0, G)) for name in sensors}).problem for t in (0, 10, 20, 30)]
    assert problems == ["", "", *[f"No motion can be used yet: {sentence}"] * 2]


def test_a_sensor_that_is_on_and_gives_no_numbers_is_named_at_once_and_only_while_it_does() -> None:
    pairing = Pairing(Signs.AUTO)
    force = {"totalacceleration": stream([0], (0, 0, G))}
    for _ in range(4):
        assert (
            "The readings of Gyroscope are not numbers:" in pairing.add(force, {"gyroscope": "are not numbers"}).problem
        )
    whole = pairing.add({name: stream([10], (0, 0, G)) for name in ("totalacceleration", "gyroscope")})
    assert (len(whole.samples), whole.problem) == (1, "")
    assert pairing.add(force, {"magnetometer": "are not numbers"}).problem == ""


def test_a_damaged_sensor_that_is_not_needed_is_not_blamed() -> None:
    upright = linear_and_gravity(-1) | {"gravity": stream([7, 27], (0, -G, 0))}
    damage = {"totalacceleration": "are not numbers"}
    assert Pairing(Signs.AUTO).add(upright, damage).problem == TILTED
    assert len(Pairing(Signs.IOS).add(upright, damage).samples) == 2
    assert "Total Acceleration are" in Pairing(Signs.AUTO).add({"gyroscope": stream([0], (0, 0, 0))}, damage).problem


def test_readings_that_are_never_near_each_other_are_told() -> None:
    pairing = Pairing(Signs.AUTO)
    problems = []
    for second in range(5):
        at_ms = 1000.0 * second
        batch = {"gyroscope": stream([at_ms + 500], (0, 0, 0)), "totalacceleration": stream([at_ms], (0, 0, G))}
        problems.append(pairing.add(batch).problem)
    assert problems == ["", "", APART, APART, APART]


def test_a_gap_in_the_accelerometer_is_not_interpolated_and_its_readings_are_counted() -> None:
    pairing = Pairing(Signs.AUTO)
    batch = {
        "gyroscope": stream([10, 500, 990], (0, 0, 0)),
        "totalacceleration": stream([0, 20, 980, 1000], (0, 0, G)),
    }
    result = pairing.add(batch)
    assert [(sample.t_ns - T_NS) / MS for sample in result.samples] == [10, 990]
    assert result.unpaired == 1


def test_a_magnetometer_that_falls_silent_holds_nothing_up_for_long() -> None:
    pairing = Pairing(Signs.AUTO)
    pairing.add({"magnetometer": stream([0], (20, 0, -40))})
    samples = []
    for second in range(3):
        times = [second * 1000.0 + t for t in range(0, 1000, 10)]
        batch = {"gyroscope": stream(times, (0, 0, 0)), "totalacceleration": stream(times, (0, 0, G))}
        samples += pairing.add(batch).samples
    assert len(samples) == 300
    assert samples[-1].mag is None
