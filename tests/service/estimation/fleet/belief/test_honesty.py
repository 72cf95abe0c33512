"""When things go wrong, the belief must not be sure of a place where the tag is not.

Seeds 2000 to 2011; the belief was tuned on others.
"""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import State, default_settings
from dropanchor_service.estimation.fleet.belief.layout import ROW
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.frontend.node import MEASURED_HEADING, RELATIVE_HEADING
from dropanchor_service.offline.accuracy import nees
from support.fleet_tracks import CALIBRATED, Drive, drive, rows_of, run, track

BURSTS_S = ((3.0, 5.0, 1.5), (12.0, 13.5, 0.8), (20.0, 23.0, 1.2))  # from, to, metres too long
BIAS = 0.1  # rad


def distance(beliefs: Any, truth: Drive) -> Any:
    return np.hypot(beliefs["x"] - truth.x, beliefs["y"] - truth.y)


def inside(beliefs: Any, truth: Drive) -> Any:
    """Return whether the truth lies in the 95 % ellipse."""
    e = np.stack([beliefs["x"] - truth.x, beliefs["y"] - truth.y], axis=1)
    return nees(e, beliefs["cov"][:, :2, :2]) < CHI2_95_OF_2


def elsewhere(beliefs: Any, truth: Drive) -> Any:
    """Return whether a belief is tracking, and further from the truth than 2 m and a tenth of the range."""
    far = distance(beliefs, truth) > np.maximum(2.0, 0.1 * np.hypot(truth.x, truth.y))
    return (beliefs["state"] == State.TRACKING) & far


def without_sight(seed: int) -> Drive:
    """Return a drive with bursts of ranges that are too long."""
    truth = drive(seed)
    t = truth.nodes["t_ns"] * 1e-9
    for first, last, excess in BURSTS_S:
        truth.nodes["z"][(t >= first) & (t < last)] += excess
    return truth


def misled(seed: int) -> Drive:
    """Return a drive with a heading reference that is wrong by a constant."""
    truth = drive(seed)
    truth.nodes["heading"] += BIAS
    return truth


def drifting(seed: int) -> Drive:
    """Return a drive with a gyroscope whose bias swings by 0.03 rad/s within a minute."""
    truth = drive(seed, legs=6)
    truth.nodes["dyaw"] += 0.03 * np.sin(2 * np.pi * truth.nodes["t_ns"] * 1e-9 / 60.0) * truth.nodes["dt_s"]
    return truth


def turning(seed: int) -> Drive:
    """Return a drive with a heading reference that is right at first, and then turns by 0.3 rad until the end."""
    truth = drive(seed, legs=6)
    t = truth.nodes["t_ns"] / truth.nodes["t_ns"][-1]
    truth.nodes["heading"] += 0.45 * np.clip(t - 1 / 3, 0.0, None)
    return truth


@pytest.mark.parametrize("known", [True, False])
def test_a_line_of_sight_that_is_blocked_for_seconds_does_not_mislead(known: bool) -> None:
    runs = [(track(d, known), d) for d in map(without_sight, range(2000, 2012))]
    assert np.mean([elsewhere(b, d).mean() for b, d in runs]) < 0.01
    assert np.mean([inside(b, d)[20:].mean() for b, d in runs]) > 0.93
    assert np.mean([distance(b, d)[-50:].max() < 2.0 for b, d in runs]) > 0.9


@pytest.mark.parametrize("known", [True, False])
def test_a_heading_reference_with_a_constant_error_never_makes_the_ellipse_exclude_the_truth(known: bool) -> None:
    runs = [(track(d, known), d) for d in map(misled, range(2000, 2012))]
    tracking = [inside(b, d)[b["state"] == State.TRACKING].mean() for b, d in runs]
    assert np.mean(tracking) > 0.93
    assert np.mean([inside(b, d)[20:].mean() for b, d in runs]) > 0.93


def test_most_tracks_far_from_their_ranges_are_given_up_within_five_seconds_and_found_again() -> None:
    """The start in the settings is 8 m from the tag."""
    truths = [drive(seed, legs=6) for seed in range(2000, 2012)]
    ends, said = [], []
    for d in truths:
        rows = rows_of(1, known=True)
        rows["start"]["x"], rows["start"]["y"] = 4.0, 5.0
        beliefs = run(rows, make_pool(512), d.nodes)
        ends.append(distance(beliefs, d)[-50:].max())
        said.append(elsewhere(beliefs, d)[50:].mean())
    assert np.mean(said) < 0.15  # measured 0.13; 0.21 with a limit of 5 m of blocked sight
    assert np.median(ends) < 1.0


def test_a_drifting_gyroscope_beside_a_heading_does_not_mislead() -> None:
    runs = [(track(d, known=True), d) for d in map(drifting, range(2000, 2012))]
    assert np.median([np.sqrt(np.mean(distance(b, d) ** 2)) for b, d in runs]) < 0.5
    assert np.mean([inside(b, d)[20:].mean() for b, d in runs]) > 0.93
    assert np.mean([elsewhere(b, d).mean() for b, d in runs]) < 0.02


def test_a_reference_that_turns_after_an_unknown_start_gets_an_error_of_its_own() -> None:
    runs = [(track(d, known=False), d) for d in map(turning, range(2000, 2012))]
    assert np.mean([elsewhere(b, d).mean() for b, d in runs]) < 0.05  # measured 0.02; 0.19 without own-error-again


def test_while_the_place_is_uncertain_the_ellipse_holds_all_the_places_where_the_tag_may_be() -> None:
    runs = [(track(d, known=False), d) for d in map(drive, range(2000, 2012))]
    ambiguous = [inside(b, d)[20:][b["state"][20:] == State.AMBIGUOUS] for b, d in runs]
    assert np.concatenate(ambiguous).mean() > 0.9


def test_a_tag_that_moves_at_its_first_sample_is_not_declared_in_the_wrong_place() -> None:
    for truth in map(drive, range(2000, 2012)):
        late = Drive(*(column[100:] for column in truth))
        beliefs = track(late, known=False)
        assert elsewhere(beliefs, late).mean() < 0.02


def mounted(seed: int, angle: float, heading_kind: int) -> Drive:
    """Return a drive of a tag whose body points to the right of its course by this angle."""
    truth = drive(seed)
    nodes = truth.nodes
    forward, left = nodes["dv_forward"].copy(), nodes["dv_left"].copy()
    nodes["dv_forward"] = forward * np.cos(angle) - left * np.sin(angle)
    nodes["dv_left"] = forward * np.sin(angle) + left * np.cos(angle)
    nodes["heading"] -= angle
    nodes["heading_kind"] = heading_kind
    return truth


@pytest.mark.parametrize("heading_kind", [RELATIVE_HEADING, MEASURED_HEADING])
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.4])
def test_an_untold_mounting_angle_is_in_the_ellipse_from_the_start(angle: float, heading_kind: int) -> None:
    held = []
    for seed in range(2000, 2012):
        truth = mounted(seed, angle, heading_kind)
        settings = default_settings()
        settings["range_std"], settings["start_known"], settings["start_x"] = 0.1, True, 10.0
        settings["start_y"], settings["start_heading"] = 0.0, truth.nodes["heading"][0]
        rows = np.zeros(1, ROW)
        rows[:] = configure_row(settings, CALIBRATED)
        beliefs = run(rows, make_pool(512), truth.nodes)
        held.append(inside(beliefs, truth)[beliefs["state"] == State.TRACKING])
    assert np.concatenate(held).mean() > 0.93
