"""Tags of the simulator that were once surely in the wrong place. No pose with `tracking` may be 5 deviations off.

Where 5 is not reached, the limit is the next one, and a comment says what it was before.
"""

from dataclasses import replace

import numpy as np
import pytest

from dropanchor_evaluation.product.rows import Row, selected, simulated_rows
from dropanchor_evaluation.product.runs import sources, tag_run
from dropanchor_evaluation.product.scores import RowScore
from dropanchor_evaluation.product.work import run_row
from dropanchor_tag_client.simulator.simulation import Simulation


def worst_sigma(name: str, seed: int) -> float:
    """Return the largest normalised error of the poses with `tracking` of one tag."""
    (row,) = selected(simulated_rows(), [name])
    (run,) = sources(row, range(seed, seed + 1))
    return run_row(row, [tag_run(row, run)]).tags[0].worst_sigma


@pytest.mark.parametrize("start", ["known", "unknown"])
def test_a_slow_tag_that_crosses_the_line_of_sight_for_long_is_not_lost(start: str) -> None:
    assert worst_sigma(f"C5/scalar/everything/{start}", 5111) < 5.0


@pytest.mark.parametrize("row", ["9-axis/everything/known", "9-axis/everything/unknown", "6-axis/everything/known"])
def test_a_tag_that_may_reverse_does_not_follow_its_mirror_image_past_the_anchor(row: str) -> None:
    assert worst_sigma(f"forklift/{row}", 5152) < 5.0


def test_a_tag_that_passes_close_to_the_anchor_keeps_its_light_hypotheses() -> None:
    assert worst_sigma("OU/scalar/everything/unknown", 5130) < 5.0


@pytest.mark.parametrize("row", ["scalar/nothing/known", "9-axis/everything/known", "6-axis/everything/unknown"])
def test_a_tag_that_passes_the_anchor_on_a_side_that_it_does_not_know_keeps_both(row: str) -> None:
    assert worst_sigma(f"OU/{row}", 21086) < 5.5  # 5.4 with nothing told


def test_a_tag_with_fast_ranges_is_not_found_before_it_moves() -> None:
    assert worst_sigma("S5-100Hz/scalar/everything/unknown", 5132) < 5.0


@pytest.mark.parametrize("told", ["everything", "mount", "nothing"])
def test_a_tag_that_rolls_smoothly_across_the_line_of_sight_is_not_taken_for_standing(told: str) -> None:
    limit = 11.0 if told == "nothing" else 5.0  # 10.6; 2.2 while a gyroscope's bias was taken to be half as large
    assert worst_sigma(f"rolling/9-axis/{told}/unknown", 5207) < limit


@pytest.mark.parametrize("start", ["known", "unknown"])
def test_a_tag_that_rolls_smoothly_across_the_line_of_sight_keeps_its_speed(start: str) -> None:
    assert worst_sigma(f"rolling/scalar/everything/{start}", 5207) < 10.0  # 7.7; 101 before tilting_growth


@pytest.mark.parametrize("seed", [5013, 5017])
def test_a_gyroscope_whose_bias_is_not_known_may_have_tilted_a_smooth_ride(seed: int) -> None:
    assert worst_sigma("rolling/9-axis/everything/unknown", seed) < 5.0


@pytest.mark.parametrize(
    ("row", "seed"), [("mount/known", 21997), ("everything/unknown", 21911), ("nothing/known", 21926)]
)
def test_a_level_ride_teaches_a_bias_that_no_rest_does(row: str, seed: int) -> None:
    assert worst_sigma(f"rolling/9-axis/{row}", seed) < 5.0


@pytest.mark.parametrize("start", ["known", "unknown"])
def test_a_tag_that_starts_in_an_arc_allows_for_the_tilt_that_it_bends(start: str) -> None:
    assert worst_sigma(f"M5/scalar/nothing/{start}", 5212) < 5.0


def test_a_tag_with_an_unknown_start_soon_finds_its_mount_rigid() -> None:
    assert worst_sigma("M5/6-axis/mount/unknown", 21015) < 5.0


@pytest.mark.parametrize("row", ["9-axis/nothing/unknown", "6-axis/mount/unknown"])
def test_a_tag_that_backs_off_after_a_stop_that_nobody_saw_turns_back(row: str) -> None:
    assert worst_sigma(f"forklift/{row}", 21247) < 5.0


def test_a_light_hypothesis_drives_off_backwards_too() -> None:
    assert worst_sigma("forklift/9-axis/nothing/known", 21063) < 5.0


@pytest.mark.parametrize(("motion", "seed"), [("C5", 5187), ("C5", 5141), ("rolling", 5192), ("rolling", 5157)])
def test_a_place_with_rivals_is_not_tracked(motion: str, seed: int) -> None:
    assert worst_sigma(f"{motion}/9-axis/nothing/known", seed) < 5.0


@pytest.mark.parametrize("what", ["S5+white1", "S5+lasting0.5", "C5+white1", "C5+lasting0.5", "C5+mean10"])
def test_ranges_that_are_worse_than_anybody_said_widen_the_ellipse(what: str) -> None:
    result = run_of(Row(what, "9-axis", "nothing", "known"), range(5000, 5008))
    assert result.coverage > 0.9  # 0.57 where errors of 0.5 m last, while the noise of ranges was assumed
    assert result.worst_sigma < 5.0  # to 75


@pytest.mark.parametrize("degrees", [90, 135, 180])
@pytest.mark.parametrize("start", ["known", "unknown"])
def test_a_tag_on_a_smooth_trolley_may_be_mounted_any_way_round(degrees: int, start: str) -> None:
    result = run_of(Row(f"rolling+mount{degrees}", "9-axis", "nothing", start), range(5000, 5004))
    assert result.worst_sigma < 7.0  # 6.0 once; to 136 while a mount within 2 rad of straight was assumed


def run_of(row: Row, seeds: range) -> RowScore:
    return run_row(row, [tag_run(row, run) for run in sources(row, seeds)]).score


@pytest.mark.parametrize("seed", [5001, 5002])
def test_a_platform_without_accelerations_is_found_since_its_heading_points_ahead(seed: int) -> None:
    (row,) = selected(simulated_rows(), ["C5/scalar/nothing/unknown"])
    (source,) = sources(row, range(seed, seed + 1))
    assert isinstance(source, Simulation)
    run = tag_run(row, source)
    headings = run.samples.headings.copy()
    headings["heading"] += np.angle(np.exp(1j * (source.truth.course - source.truth.heading)).mean())
    samples = replace(run.samples, imu=run.samples.imu[:0], headings=headings)
    score = run_row(row, [replace(run, samples=samples)]).tags[0]
    assert score.tracking_share > 0.5
    assert score.second_half < 1.0
    assert score.worst_sigma < 5.0
