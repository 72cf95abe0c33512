"""Compare the starts that people tell with the ranges that follow.

A start is confirmed once ranges have agreed with it without interruption over a way of 3 m and for 2 s, or for 10 s
where the tag hardly moves. Of 24 simulated starts that were wrong by 10 m, 20 m or 180°
and whose ranges told their noise, the ranges denied 14 within 30 s, of which 2 had been confirmed before, and 10 stayed
confirmed. Where ranges told no noise, 1 was confirmed. All 16 right ones were.
"""

import numpy as np

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import (
    Array,
    DeniesStarts,
    Engine,
    MeasurementKind,
    PoseBatch,
    State,
    StateReason,
)
from dropanchor_service.store.records import enlarged, take
from dropanchor_service.store.rings import rank_in_row
from dropanchor_service.store.starts import StartNews, StartNewsQueue, StartPhase

MOVING_S, MOVING_M = 2.0, 3.0
STANDING_S = 10.0
SETTLED_M = 50.0  # way over which the ranges agreed: then a contradiction is no longer one of the start
MAX_NIS = 9.0  # of a range that agrees: three standard deviations
MAX_LASTING_M = 0.5  # of errors of ranges that last: while they are believed to be larger, ranges confirm nothing
MAX_STEP_S = 0.5  # between two ranges: a longer silence says nothing about the way

OPEN = np.dtype(
    [
        ("is_open", "?"),  # ranges may still deny it
        ("is_confirmed", "?"),
        ("is_enough", "?"),  # what ranges have said confirms it
        ("agreed_s", "f8"),  # since the last range that did not agree
        ("agreed_m", "f8"),
        ("way_m", "f8"),  # over which ranges agreed, in all
        ("last_ns", "i8"),  # of the last pose, 0: none
    ]
)


class StartWatch:
    """The starts by row. Owned by the ingest thread. An engine that denies no start leaves none open."""

    def __init__(self, engine: Engine, news: StartNewsQueue) -> None:
        """news: receives what becomes of the starts, in order."""
        self._engine = engine if isinstance(engine, DeniesStarts) else None
        self._news = news
        self._starts = np.zeros(0, OPEN)
        self._count = 0  # of open ones

    def tell(self, row: int, tag: TagSettings, earlier: TagSettings | None) -> None:
        """Follow a row that starts again with these settings. earlier: those before.

        Events may hang on a start that an earlier process followed: so a first row tells that it has none.
        """
        self._set(row, tag.start is not None)
        place, before = _place(tag), "" if earlier is None else _place(earlier)
        if self._engine is not None and (place or before or earlier is None):
            self._news.append(StartNews(row, StartPhase.TOLD, place, before))

    def resume(self, row: int, tag: TagSettings) -> None:
        """Follow a row with these settings that goes on from a checkpoint.

        Events that an earlier process stored may still hang on a start that the engine no longer follows.
        """
        if self._engine is None or tag.start is None:
            return
        if self._engine.are_at_start(np.array([row]))[0]:
            self._set(row, is_open=True)
            self._news.append(StartNews(row, StartPhase.RESUMED, _place(tag)))
        else:
            self._news.append(StartNews(row, StartPhase.ENDED))

    def end(self, row: int) -> None:
        """Stop following a row that starts again, wherever its tag is."""
        if row < len(self._starts) and self._starts["is_open"][row]:
            self._close(row, StartPhase.ENDED)

    def look(self, batch: PoseBatch) -> None:
        """Compare new poses with the starts that are open."""
        if self._engine is None or not self._count:
            return
        poses = take(batch.poses, self._are_open(batch.poses["row"]))
        if not len(poses):
            return
        agree, rank = _agree(poses, batch.innovations), rank_in_row(poses["row"])
        for nth in range(int(rank.max()) + 1):  # of each row; mostly there is one
            self._add(take(poses, rank == nth), agree[rank == nth])
        rows, on_ring = np.unique(poses["row"]), set(poses["row"][_are_on_ring(poses)].tolist())
        for row in rows[~self._engine.are_at_start(rows)].tolist():
            self._close(row, StartPhase.DENIED if row in on_ring else StartPhase.ENDED)
        self._note_agreement(rows)

    def _set(self, row: int, is_open: bool) -> None:
        if self._engine is None:
            return
        if row >= len(self._starts):
            self._starts = enlarged(self._starts, 2 * (row + 1))
        self._count += int(is_open) - int(self._starts["is_open"][row])
        self._starts[row] = np.zeros((), OPEN)
        self._starts["is_open"][row] = is_open

    def _close(self, row: int, phase: StartPhase) -> None:
        self._set(row, is_open=False)
        self._news.append(StartNews(row, phase))

    def _are_open(self, rows: Array) -> Array:
        known = rows < len(self._starts)
        known[known] = self._starts["is_open"][rows[known]]
        return known

    def _add(self, poses: Array, agree: Array) -> None:
        """Add what poses of different rows say. agree: of each pose, whether its range does; NaN: it met no belief."""
        starts = take(self._starts, poses["row"])
        step_s = np.clip((poses["t_ns"] - starts["last_ns"]) * 1e-9, 0.0, MAX_STEP_S)
        step_s[(starts["last_ns"] == 0) | (agree != 1)] = 0.0
        step_m = np.nan_to_num(np.abs(poses["speed"])) * step_s
        starts["last_ns"] = poses["t_ns"]
        for name, step in (("agreed_s", step_s), ("agreed_m", step_m), ("way_m", step_m)):
            starts[name] += step
        for name in ("agreed_s", "agreed_m"):
            starts[name][agree == 0] = 0.0
        moved = (starts["agreed_m"] >= MOVING_M) & (starts["agreed_s"] >= MOVING_S)
        starts["is_enough"] |= moved | (starts["agreed_s"] >= STANDING_S)
        self._starts[poses["row"]] = starts

    def _note_agreement(self, rows: Array) -> None:
        """Tell which starts of these rows have become confirmed or settled."""
        starts = take(self._starts, rows)
        for row in rows[starts["is_open"] & starts["is_enough"] & ~starts["is_confirmed"]].tolist():
            self._starts["is_confirmed"][row] = True
            self._news.append(StartNews(row, StartPhase.CONFIRMED))
        for row in rows[starts["is_open"] & starts["is_enough"] & (starts["way_m"] >= SETTLED_M)].tolist():
            self._close(row, StartPhase.SETTLED)


def _agree(poses: Array, innovations: Array) -> Array:
    """Return of each pose whether its range agrees with what was predicted, 1 or 0; NaN: it met no belief."""
    ranges = take(innovations, innovations["kind"] == MeasurementKind.RANGE)
    agree = ranges["fused"] & (ranges["innovation"] ** 2 < MAX_NIS * ranges["S"])
    agree &= ~(ranges["lasting_std"] > MAX_LASTING_M)
    _, instants = np.unique(np.concatenate([ranges["t_ns"], poses["t_ns"]]), return_inverse=True)
    keys = np.concatenate([ranges["row"], poses["row"]]).astype(np.int64) * (len(instants) + 1) + instants
    known, asked = keys[: len(ranges)], keys[len(ranges) :]
    order = np.argsort(known, kind="stable")
    place = np.searchsorted(known[order], asked, side="right") - 1  # the last of several
    found = np.full(len(poses), np.nan)
    met = (place >= 0) & (known[order][np.maximum(place, 0)] == asked) if len(ranges) else np.zeros(len(poses), bool)
    found[met] = agree[order][place[met]]
    return found


def _are_on_ring(poses: Array) -> Array:
    """Return where the engine looks for the tag at all bearings, as it does after ranges have denied its place."""
    on_ring: Array = (poses["state"] == State.AMBIGUOUS) & (poses["reason"] == StateReason.SEVERAL_MODES)
    return on_ring


def _place(tag: TagSettings) -> str:
    """Return the start in the settings as text, empty if there is none."""
    return "" if tag.start is None else tag.start.model_dump_json()
