"""The compiled belief as a whole: accuracy, honesty, determinism and isolation of rows."""

from typing import Any

import numpy as np

from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import State, StateReason
from dropanchor_service.estimation.fleet.belief.layout import MAX_HYPOTHESES
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from support.fleet_tracks import Drive, drive, rows_of, run, track


def errors(beliefs: Any, truth: Drive) -> Any:
    return np.hypot(beliefs["x"] - truth.x, beliefs["y"] - truth.y)


def inside(beliefs: Any, truth: Drive) -> Any:
    """Return whether the truth lies in the 95 % ellipse."""
    e = np.stack([beliefs["x"] - truth.x, beliefs["y"] - truth.y], axis=1)
    P = beliefs["cov"][:, :2, :2]
    return np.einsum("ni,nij,nj->n", e, np.linalg.inv(P), e) < CHI2_95_OF_2


def test_from_a_known_start_every_run_stays_on_the_track_and_the_ellipses_hold() -> None:
    found = [(track(d, known=True), d) for d in map(drive, range(2000, 2012))]
    rmse = [float(np.sqrt(np.mean(errors(b, d) ** 2))) for b, d in found]
    cover = [float(inside(b, d).mean()) for b, d in found]
    assert np.median(rmse) < 0.25
    assert max(rmse) < 1.0
    assert np.mean(cover) > 0.93


def test_from_an_unknown_start_the_tag_is_found_and_never_declared_in_the_wrong_place() -> None:
    for truth in map(drive, range(2000, 2010)):
        beliefs = track(truth, known=False)
        declared = beliefs["state"] == State.TRACKING
        assert declared[-1]
        first = int(np.argmax(declared))
        assert errors(beliefs, truth)[first] < max(2.0, 0.1 * np.hypot(truth.x[first], truth.y[first]))
        assert errors(beliefs, truth)[-50:].max() < 2.0


def test_a_straight_line_is_never_declared_resolved_from_an_unknown_start() -> None:
    for truth in (drive(seed, legs=4, turns=0.0) for seed in range(2000, 2006)):
        beliefs = track(truth, known=False)
        assert set(beliefs["state"]) <= {State.INITIALISING, State.AMBIGUOUS}
        assert beliefs["reason"][-1] in (StateReason.SEVERAL_MODES, StateReason.UNCERTAIN)


def test_results_do_not_depend_on_how_the_nodes_were_cut_into_batches() -> None:
    nodes = np.concatenate([drive(2000 + k, row=k).nodes for k in range(3)])
    nodes = nodes[np.argsort(nodes["t_ns"], kind="stable")]
    whole = run(rows_of(3, known=False), make_pool(2048), nodes)
    rows, pool, parts = rows_of(3, known=False), make_pool(2048), []
    for part in np.array_split(nodes, 37):
        parts.append(run(rows, pool, part))
    assert whole.tobytes() == np.concatenate(parts).tobytes()


def test_a_row_with_invalid_samples_starts_again_and_leaves_its_neighbour_alone() -> None:
    alone = track(drive(2001), known=True)
    mixed = np.concatenate([drive(2000, row=0).nodes, drive(2001, row=1).nodes])
    mixed["z"][100] = np.nan
    mixed = mixed[np.argsort(mixed["t_ns"], kind="stable")]
    rows = rows_of(2, known=True)
    beliefs = run(rows, make_pool(1024), mixed)
    assert rows["faults"].tolist() == [1, 0]
    assert beliefs[mixed["row"] == 1].tobytes() == alone.tobytes()


def test_slots_of_a_row_go_back_to_the_pool() -> None:
    rows, pool = rows_of(1, known=False), make_pool(512)
    run(rows, pool, drive(2003).nodes)
    free, slot = 0, pool["next"][0]
    while slot >= 0:
        free, slot = free + 1, pool["next"][slot]
    assert free + rows["count"][0] == 511


def test_silence_is_called_coasting_and_then_lost() -> None:
    truth = drive(2004)
    nodes = np.concatenate([truth.nodes, np.repeat(truth.nodes[-1:], 320)])
    nodes["kind"][len(truth.nodes) :] = 0
    nodes["dyaw"][len(truth.nodes) :] = 0.0
    beliefs = run(rows_of(1, known=True), make_pool(512), nodes)
    silent = beliefs[len(truth.nodes) :]
    assert silent["state"][5] == State.TRACKING
    assert silent["state"][30] == State.COASTING
    assert silent["state"][-1] == State.LOST
    assert silent["sigma_pos"][-1] > silent["sigma_pos"][0]


def test_ranges_alone_do_not_fix_a_tag_that_stands_still() -> None:
    truth = drive(2005)
    nodes = truth.nodes[:60].copy()
    nodes[:] = nodes[0]
    nodes["t_ns"] = np.arange(60) * 100_000_000
    nodes["rest"] = 1
    beliefs = run(rows_of(1, known=True), make_pool(512), nodes)
    assert np.isinf(beliefs["sigma_obs"][-1])
    assert np.isfinite(track(truth, known=True)["sigma_obs"][-1])


def test_a_tag_that_may_reverse_is_found_too_or_stays_ambiguous() -> None:
    for truth in map(drive, range(2000, 2004)):
        rows = rows_of(1, known=False)
        rows["settings"]["reverse_allowed"] = 1
        moving = truth.nodes[15:]  # it moves from its first range on: the ring has both directions of travel
        beliefs = run(rows, make_pool(512), moving)
        assert rows["count"][0] <= MAX_HYPOTHESES
        assert rows["faults"][0] == 0
        if beliefs["state"][-1] == State.TRACKING:
            assert np.hypot(beliefs["x"][-1] - truth.x[-1], beliefs["y"][-1] - truth.y[-1]) < 2.0
