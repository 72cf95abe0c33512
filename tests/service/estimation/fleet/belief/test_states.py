"""The states that the engine `fleet` gives its poses, each with the reason of its rule."""

from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import State, StateReason
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from dropanchor_service.estimation.fleet.frontend.node import NO_HEADING
from support.fleet_tracks import drive, rows_of, run, track


def judged(beliefs: Any) -> list[tuple[State, StateReason]]:
    return [(State(b["state"]), StateReason(b["reason"])) for b in beliefs]


def test_a_known_start_is_tracked_from_the_first_range_on() -> None:
    assert set(judged(track(drive(2000), known=True))) == {(State.TRACKING, StateReason.RESOLVED)}


def test_an_unknown_start_waits_for_ranges_then_has_several_modes_then_is_resolved() -> None:
    seen = list(dict.fromkeys(judged(track(drive(2000), known=False))))
    assert seen[:3] == [
        (State.INITIALISING, StateReason.NO_RANGE),
        (State.AMBIGUOUS, StateReason.SEVERAL_MODES),
        (State.TRACKING, StateReason.RESOLVED),
    ]


def test_ranges_without_any_heading_wait_for_one() -> None:
    nodes = drive(2000).nodes[:20]
    nodes["heading_kind"] = NO_HEADING
    assert set(judged(run(rows_of(1, known=False), make_pool(512), nodes))) == {
        (State.INITIALISING, StateReason.NO_HEADING)
    }


def test_a_place_that_is_as_good_as_the_compass_says_that_it_is_the_heading() -> None:
    rows = rows_of(1, known=False)
    rows["settings"]["reference_std"] = 0.5  # a compass beside steel: 5 m at 10 m, whatever the ranges say
    beliefs = run(rows, make_pool(512), drive(2000).nodes)
    assert judged(beliefs)[-1] == (State.AMBIGUOUS, StateReason.HEADING_UNSURE)
    assert beliefs["sigma_pos"][-1] > 3.0
    assert not (beliefs["state"] == State.TRACKING).any()


def test_ranges_that_contradict_the_track_degrade_it() -> None:
    nodes = drive(2000).nodes
    nodes["z"][150:200] += np.random.default_rng(1).uniform(3.0, 9.0, 50)
    seen = set(judged(run(rows_of(1, known=True), make_pool(512), nodes)[150:200]))
    assert (State.DEGRADED, StateReason.RANGES_REJECTED) in seen


def test_numbers_that_break_a_row_start_it_afresh() -> None:
    nodes = drive(2000).nodes[:40]
    nodes["dyaw"][20] = np.inf
    assert judged(run(rows_of(1, known=True), make_pool(512), nodes))[20] == (State.INITIALISING, StateReason.FAULT)
