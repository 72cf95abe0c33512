"""A track without north: good in a frame of its own, and turned into the site by whatever tells how."""

from typing import Any

import numpy as np
import pytest

from dropanchor_evaluation.product.scores import rotated_onto
from dropanchor_service.estimation.columns import State, anchors_at
from dropanchor_service.estimation.fleet.belief.layout import BELIEF
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, RELATIVE_HEADING
from dropanchor_service.offline.accuracy import nees
from support.fleet_tracks import CALIBRATED, Drive, drive, rows_of

SECOND = (6.0, 14.0)
SEEDS = range(2000, 2008)


def without_north(seed: int, legs: int = 6) -> Drive:
    """Return a drive whose yaw counts from wherever the body pointed first."""
    d = drive(seed, legs=legs)
    d.nodes["heading"] -= d.nodes["heading"][0]
    d.nodes["heading_kind"] = RELATIVE_HEADING
    return d


def run(d: Drive, mount_std: float = 0.0) -> Any:
    rows = rows_of(1, known=False)
    rows["settings"]["mount_angle_std"] = mount_std
    anchors = anchors_at((0.0, 0.0, 0.0), (*SECOND, 0.0))
    beliefs = np.zeros(len(d.nodes), BELIEF)
    assert advance(rows, make_pool(512), d.nodes, anchors, CALIBRATED.record(), make_workspace(), beliefs) == 0
    return beliefs


def errors(beliefs: Any, d: Drive, turned: bool) -> Any:
    """Return found minus true (n, 2). turned: after the best rotation about the anchor."""
    found, true = np.column_stack([beliefs["x"], beliefs["y"]]), np.column_stack([d.x, d.y])
    return found - (rotated_onto(true, found, beliefs["state"] == State.TRACKING, (0.0, 0.0)) if turned else true)


@pytest.mark.parametrize("mount_std", [0.0, 0.5])
def test_a_tag_without_north_tracks_in_its_own_frame_and_its_ellipse_holds_it_there(mount_std: float) -> None:
    ends, inside = [], []
    for d in map(without_north, SEEDS):
        beliefs = run(d, mount_std)
        tracking = beliefs["state"] == State.TRACKING
        assert beliefs["relative"][beliefs["hypotheses"] > 0].all()
        assert tracking[-1]
        error = errors(beliefs, d, turned=True)
        ends.append(np.hypot(*error[-100:].T).max())
        inside.append((nees(error, beliefs["cov"][:, :2, :2])[tracking] < 5.99).mean())
    assert np.median(ends) < 1.0
    assert np.mean(inside) > 0.93


def test_the_x_axis_is_the_first_direction_of_travel() -> None:
    d = without_north(2003)
    beliefs = run(d)
    assert beliefs["course"][60] == pytest.approx(0.0, abs=0.1)  # still on the first leg


def test_a_second_anchor_turns_the_track_into_the_site() -> None:
    ends = []
    for d in map(without_north, SEEDS):
        later = np.arange(300, len(d.nodes))[::2]
        d.nodes["anchor"][later] = 1
        distance = np.hypot(d.x[later] - SECOND[0], d.y[later] - SECOND[1])
        d.nodes["z"][later] = distance + 0.1 * np.random.default_rng(5).standard_normal(len(later))
        beliefs = run(d)
        if beliefs["state"][299] == State.TRACKING:
            assert beliefs["relative"][299] == 1
            assert not beliefs["relative"][-1]
            assert beliefs["state"][-1] == State.TRACKING
            ends.append(np.hypot(*errors(beliefs, d, turned=False)[-1]))
    assert len(ends) >= 5
    assert np.median(ends) < 0.5


def test_ranges_to_a_second_anchor_do_no_harm_before_the_track_is_resolved() -> None:
    d = without_north(2001)
    d.nodes["anchor"][40:60:2] = 1
    d.nodes["z"][40:60:2] = np.hypot(d.x[40:60:2] - SECOND[0], d.y[40:60:2] - SECOND[1])
    beliefs = run(d)
    assert beliefs["state"][59] != State.TRACKING
    assert beliefs["relative"][59] == 1
    assert np.hypot(*errors(beliefs, d, turned=True)[-1]) < 1.0


def test_a_magnetometer_turns_the_track_once_it_knows_north_well() -> None:
    d, plain = without_north(2003), drive(2003, legs=6)
    d.nodes["heading"][300:], d.nodes["heading_kind"][300:] = plain.nodes["heading"][300:], ABSOLUTE_HEADING
    d.nodes["heading_var"][300:400], d.nodes["heading_var"][400:] = 0.15, 0.03**2
    beliefs = run(d)
    assert beliefs["relative"][399] == 1  # north was worse than 0.2 rad
    assert not beliefs["relative"][400:].any()
    assert np.hypot(*errors(beliefs, d, turned=False)[-1]) < 1.0
