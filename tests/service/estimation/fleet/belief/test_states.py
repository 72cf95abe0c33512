"""The states that the engine `fleet` gives its poses, each with the reason of its rule."""

from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import State, StateReason
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, PHI, N
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from dropanchor_service.estimation.fleet.belief.publish import publish
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, NO_HEADING
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, node_of
from support.fleet_tracks import ANCHORS, drive, rows_of, run, track


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
    nodes = drive(2000).nodes
    nodes["heading_kind"] = ABSOLUTE_HEADING
    beliefs = run(rows, make_pool(512), nodes)
    assert judged(beliefs)[-1] == (State.AMBIGUOUS, StateReason.HEADING_UNSURE)
    assert beliefs["sigma_pos"][-1] > 3.0
    assert not (beliefs["state"] == State.TRACKING).any()


def test_ranges_that_contradict_the_track_degrade_it() -> None:
    nodes = drive(2000).nodes
    nodes["z"][150:200] += np.random.default_rng(1).uniform(3.0, 9.0, 50)
    seen = set(judged(run(rows_of(1, known=True), make_pool(512), nodes)[150:200]))
    assert (State.DEGRADED, StateReason.RANGES_REJECTED) in seen


def test_a_tag_is_ambiguous_while_its_best_mode_has_a_rival_and_returns_when_it_is_clearly_the_best() -> None:
    row = rows_of(1, known=True).view(np.recarray)[0]
    row["publication"]["resolved"] = 1
    states = []
    for weight in (0.99, 0.91, 0.89, 0.94, 0.96, 0.91):
        space = make_workspace()[0]
        for one, share, bearing in zip(space["hypotheses"][:2], (weight, 1.0 - weight), (0.0, 2.0), strict=True):
            one["mean"], one["cov"], one["log_weight"] = STATE, 1e-4 * np.eye(N), np.log(share)
            one["mean"][PHI] = bearing
        belief = np.zeros(1, BELIEF).view(np.recarray)[0]
        publish(space["hypotheses"], 2, row, node_of(), ANCHORS, Tuning().record()[0], belief, space["scratch"])
        states.append((round(float(belief["p_mode"]), 2), State(row["publication"]["state"])))
    assert states == [
        (0.99, State.TRACKING),
        (0.91, State.TRACKING),
        (0.89, State.AMBIGUOUS),
        (0.94, State.AMBIGUOUS),
        (0.96, State.TRACKING),
        (0.91, State.TRACKING),
    ]


def test_numbers_that_break_a_row_start_it_afresh() -> None:
    nodes = drive(2000).nodes[:40]
    nodes["dyaw"][20] = np.inf
    assert judged(run(rows_of(1, known=True), make_pool(512), nodes))[20] == (State.INITIALISING, StateReason.FAULT)
