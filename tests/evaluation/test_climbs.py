"""Tags whose height changes: with a barometer as good as on level ground, without one never wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.runs import TagRun, sources, tag_run
from dropanchor_evaluation.product.scores import RowScore, score, summary
from dropanchor_evaluation.product.work import run_tags
from dropanchor_service.estimation.columns import HeightMotion
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.climbs import CLIMBS, Barometer, HeightScore, climbing, height_score

SEEDS = range(20_000, 20_008)
ROW = Row("S5", "9-axis", "everything", "known")
AT_ONCE = [name for name in CLIMBS if name.startswith("step")]


@pytest.fixture(scope="module")
def runs() -> list[TagRun]:
    return [tag_run(ROW, one) for one in sources(ROW, SEEDS)]


def scores(
    runs: Sequence[TagRun], climb: str, barometer: Barometer | None, motion: HeightMotion = HeightMotion.AUTO
) -> tuple[RowScore, list[HeightScore]]:
    """Return the scores of these tags while they climb."""
    climbed = [climbing(run, CLIMBS[climb], barometer, seed) for run, seed in zip(runs, SEEDS, strict=True)]
    told = [replace(run, settings=run.settings.copy()) for run, _ in climbed]
    for run in told:
        run.settings["height_motion"] = motion
    tracks, _ = run_tags(FleetEngine(), told)
    of_place = [score(r.name, track, r.truth, (0.0, 0.0), False) for r, track in zip(told, tracks, strict=True)]
    heights = [height_score(track, height) for track, (_, height) in zip(tracks, climbed, strict=True)]
    return summary(of_place, 0.0), heights


@pytest.fixture(scope="module")
def level(runs: list[TagRun]) -> RowScore:
    return scores(runs, "flat", None)[0]


@pytest.mark.parametrize("climb", CLIMBS)
def test_with_a_barometer_a_climb_costs_nothing_and_its_height_is_known(
    runs: list[TagRun], level: RowScore, climb: str
) -> None:
    place, heights = scores(runs, climb, Barometer())
    # Ten metres up and down, near the anchor: the temperature of the air, which nobody told, is part of the error.
    allowed = 1.5 if climb == "sine 10 m" else 1.1
    assert place.worst_sigma < 5.5
    assert place.coverage > 0.95
    assert np.mean([one.coverage for one in heights]) > 0.93
    if climb not in AT_ONCE:  # what jumps may be the air, and is half believed
        assert place.second_half[0] < allowed * level.second_half[0]
        assert max(one.worst_sigma for one in heights) < 5.0
        assert np.median([one.rmse for one in heights]) < 0.5


@pytest.mark.parametrize("climb", ["flat", *AT_ONCE, "sine 10 m", "drone"])
def test_a_tag_that_climbs_without_a_barometer_is_wide_and_not_wrong(runs: list[TagRun], climb: str) -> None:
    place, heights = scores(runs, climb, None, HeightMotion.FREE)
    assert not place.worst_sigma > 5.0  # NaN: it never tracks
    assert max(one.worst_sigma for one in heights) < 5.0


def test_without_the_filter_a_climb_is_a_lie(runs: list[TagRun]) -> None:
    place, _ = scores(runs, "step 10 m", None)
    assert place.worst_sigma > 5.0
