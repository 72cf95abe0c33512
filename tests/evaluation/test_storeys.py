"""Tags in a lift and on stairs: their floor is right soon after a change, and a wrong one is hardly ever believed."""

from collections.abc import Callable

import pytest

from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.runs import TagRun, sources, tag_run
from dropanchor_evaluation.product.work import run_tags
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.climbs import CLIMBS, Barometer, Height, climbing
from support.storeys import FloorScore, floor_score, lift, slammed, warmed

SEEDS = range(5000, 5008)
ROW = Row("S5", "9-axis", "everything", "known")


@pytest.fixture(scope="module")
def runs() -> list[TagRun]:
    return [tag_run(ROW, one) for one in sources(ROW, SEEDS)]


def floors(runs: list[TagRun], height: Height, fault: Callable[[TagRun], TagRun] = lambda run: run) -> FloorScore:
    climbed = [climbing(run, height, Barometer(), seed) for run, seed in zip(runs, SEEDS, strict=True)]
    tracks, _ = run_tags(FleetEngine(), [fault(run) for run, _ in climbed])
    return floor_score(tracks, [height for _, height in climbed])


@pytest.mark.parametrize("height", [CLIMBS["flat"], lift, CLIMBS["stairs"]], ids=["flat", "lift", "stairs"])
def test_the_floor_is_right_five_seconds_after_a_change(runs: list[TagRun], height: Height) -> None:
    found = floors(runs, height)
    assert found.settled > 0.5 * found.poses
    assert found.right >= 0.97 * found.settled  # on stairs a tag passes the height of a floor for some seconds
    assert found.believed > 0.8 * found.poses  # while it climbs, the barometer may be late
    assert found.wrong <= 0.002 * found.poses  # of which all are within 0.3 m of the floor between two storeys


@pytest.mark.parametrize("height", [CLIMBS["flat"], lift], ids=["flat", "lift"])
def test_a_door_that_slams_makes_no_wrong_floor_believed(runs: list[TagRun], height: Height) -> None:
    quiet, slammed_once = floors(runs, height), floors(runs, height, slammed)
    assert slammed_once.wrong <= quiet.wrong
    assert slammed_once.believed < quiet.believed  # meanwhile no floor is sure


@pytest.mark.parametrize("pa_per_k", [-0.6, 0.6])  # data sheet of the BMP390; a BMP280 has 1.5 Pa/K, and is 2.5 m off
def test_a_barometer_in_the_sun_hardly_makes_a_wrong_floor_believed(runs: list[TagRun], pa_per_k: float) -> None:
    found = floors(runs, lift, lambda run: warmed(run, pa_per_k, 20.0))
    assert found.wrong <= 0.005 * found.poses
