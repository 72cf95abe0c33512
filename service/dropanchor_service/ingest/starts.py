"""Compare the starts that people tell with the ranges that follow.

A start is confirmed once ranges have agreed with it without interruption over a way of 3 m and for 2 s, or for 10 s
where the tag hardly moves. Of 24 simulated starts that were wrong by 10 m, 20 m or 180°
and whose ranges told their noise, the ranges denied 14 within 30 s, of which 2 had been confirmed before, and 10 stayed
confirmed. Where ranges told no noise, 1 was confirmed. All 16 right ones were.
"""

import numpy as np

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import Array, PoseBatch, State, StateReason
from dropanchor_service.estimation.protocols import DeniesStarts, Engine
from dropanchor_service.ingest.kernels.starts import OPEN, SETTLED_M, follow_starts
from dropanchor_service.store.records import enlarged, take
from dropanchor_service.store.starts import StartNews, StartNewsQueue, StartPhase


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

    def end_left(self) -> None:
        """Stop following rows that begin again elsewhere, because an anchor was corrected."""
        rows = np.flatnonzero(self._starts["is_open"])
        if self._engine is not None and len(rows):
            for row in rows[~self._engine.are_at_start(rows)].tolist():
                self._close(row, StartPhase.ENDED)

    def look(self, batch: PoseBatch) -> None:
        """Compare new poses with the starts that are open."""
        if self._engine is None or not self._count:
            return
        rows = np.empty(len(batch.poses), np.int64)
        count, has_news = follow_starts(batch.poses, batch.innovations, self._starts, rows)
        if not count:
            return
        rows = np.unique(rows[:count])
        at_start = self._engine.are_at_start(rows)
        if not at_start.all():
            self._note_left(rows[~at_start], batch.poses)
        if has_news:
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

    def _note_left(self, rows: Array, poses: Array) -> None:
        """Tell that these rows follow their starts no longer, and whether ranges have denied them."""
        on_ring = set(poses["row"][_are_on_ring(poses)].tolist())
        for row in rows.tolist():
            self._close(row, StartPhase.DENIED if row in on_ring else StartPhase.ENDED)

    def _note_agreement(self, rows: Array) -> None:
        """Tell which starts of these rows have become confirmed or settled."""
        starts = take(self._starts, rows)
        for row in rows[starts["is_open"] & starts["is_enough"] & ~starts["is_confirmed"]].tolist():
            self._starts["is_confirmed"][row] = True
            self._news.append(StartNews(row, StartPhase.CONFIRMED))
        for row in rows[starts["is_open"] & starts["is_enough"] & (starts["way_m"] >= SETTLED_M)].tolist():
            self._close(row, StartPhase.SETTLED)


def _are_on_ring(poses: Array) -> Array:
    """Return where the engine looks for the tag at all bearings, as it does after ranges have denied its place."""
    on_ring: Array = (poses["state"] == State.AMBIGUOUS) & (poses["reason"] == StateReason.SEVERAL_MODES)
    return on_ring


def _place(tag: TagSettings) -> str:
    """Return the start in the settings as text, empty if there is none."""
    return "" if tag.start is None else tag.start.model_dump_json()
