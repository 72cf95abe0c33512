"""Keep what arrives, with a checkpoint every few minutes. A thread of its own writes."""

import errno
import logging
import math
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Event
from typing import Self

from dropanchor_service.blackbox.block import BoxTurn, Doubts, Messages, encoded_turns
from dropanchor_service.blackbox.pieces import Head, Limits, OpenPiece, drop_oldest, lacks_room, prune
from dropanchor_service.checkpoints.format import Snapshot
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.runtime.background_writer import BackgroundWriter
from dropanchor_service.runtime.helper_process import HelperProcess
from dropanchor_service.store import Sites

RUN_S = 300.0  # that a question may take on a busy machine: what it may cost is limited by its CPU time
WRITE_S = 10.0  # so much of it a kill can lose
MAX_QUEUED_BYTES = 64 * 2**20
MESSAGE_OVERHEAD = 150  # bytes of a queued message beside its payload
PIECE_S, LONGEST_PIECE_S = 60.0, 900.0
STATE_SHARE = 0.25  # of what a piece takes: longer pieces where many tags have large checkpoints
PATIENT_S = 10.0  # a checkpoint waits so long for a moment at which no message waits for another one, and after a loss

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class _Sync:
    """is_done: set when all that was queued before is written, or lost."""

    is_done: Event = field(default_factory=Event)


@dataclass(frozen=True, kw_only=True)
class _Begin(_Sync):
    """A new piece begins before the next turn. snapshot: None with an engine that keeps no state."""

    t_ns: int
    session: str
    head: Head
    layout: str
    snapshot: Snapshot | None


class BlackBox:
    """The ingest thread calls `on_messages` and `between_turns`. It writes while this context is open.

    state: what a checkpoint holds; None with an engine that keeps none. metadata: what a run needs of the settings.
    """

    def __init__(
        self,
        folder: Path,
        limits: Limits,
        sites: Sites,
        state: ServiceState | None,
        now_ns: Callable[[], int],
        metadata: Mapping[str, str],
        clock: Callable[[], float] = time.monotonic,
        max_queued_bytes: int = MAX_QUEUED_BYTES,
    ) -> None:
        self.folder = folder
        self.runs = HelperProcess("dropanchor_service.blackbox", RUN_S, "running the past again")
        self._limits = limits
        self._sites = sites
        self._state = state
        self._now_ns = now_ns
        self._metadata = metadata
        self._clock = clock
        self._changed: deque[int] = deque()  # indices of sites
        for site in sites:
            site.store.on_change.append(partial(self._changed.append, site.index))
        self._doubts_told = 0  # of `AnchorDoubts.changes`
        self._began_s: float | None = None  # the last piece; None: a new one is to begin
        self._tried_s = -math.inf
        self._begin: _Begin | None = None  # the last one: at most one waits for the disk, whatever its size
        self._messages = self._of_piece = 0
        self._dropped = 0
        self._piece: OpenPiece | None = None  # of the writing thread, as the next ones
        self._state_bytes = 0
        self._failed: str | None = None
        self.writer: BackgroundWriter[BoxTurn | _Sync] = BackgroundWriter(
            "the black box", self._write, WRITE_S, max_queued_bytes
        )

    def __enter__(self) -> Self:
        self.writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.stop()
        if self._piece is not None and not self.writer.is_alive:
            self._piece.close()
            self._piece = None

    @property
    def problem(self) -> str | None:
        """Why nothing can be kept now, None if it can."""
        return self._failed or self.writer.problem

    def on_messages(self, messages: Messages) -> None:
        """Keep the messages of a turn, unless some before it were lost."""
        if self._is_broken:
            return
        documents = {}
        while self._changed:
            site = self._sites[self._changed.popleft()]
            documents[site.id] = site.store.document
        size = sum(len(message[1]) for message in messages) + MESSAGE_OVERHEAD * len(messages)
        is_known = self._doubts_told == self._sites.rows.anchor_doubts.changes
        self.writer.put(BoxTurn(self._now_ns(), messages, documents, None if is_known else self._doubts()), size)
        self._messages += len(messages)

    def _doubts(self) -> Doubts:
        doubts = self._sites.rows.anchor_doubts
        self._doubts_told = doubts.changes
        return sorted({(self._sites.of_row(row).id, tuple(doubt)) for row, doubt in doubts.of_rows.items()})

    def write_now(self, wait_s: float) -> None:
        """Wait until what has arrived is written."""
        sync = _Sync()
        self.writer.put(sync, 0)
        self.writer.wake()
        sync.is_done.wait(wait_s)

    def between_turns(self, has_pending: bool) -> None:
        """Begin a new piece when it is time, with a checkpoint of this moment.

        has_pending: whether a message waits for one numbered before it: a checkpoint holds none of them.
        """
        if self._is_due(has_pending):
            self._begin_piece()

    @property
    def _is_broken(self) -> bool:
        """Whether something is missing since the last piece began, or none has begun."""
        return self._began_s is None or self.writer.dropped != self._dropped

    def _is_due(self, has_pending: bool) -> bool:
        if self._begin is not None and not self._begin.is_done.is_set():
            return False
        old_s = self._clock() - self._tried_s
        if self._is_broken:
            return old_s >= PATIENT_S
        if old_s < PIECE_S or self._messages == self._of_piece:
            return False
        piece = self._piece
        is_short = piece is not None and self._state_bytes > STATE_SHARE * piece.size
        if is_short and old_s < LONGEST_PIECE_S:
            return False
        return not has_pending or old_s > PIECE_S + PATIENT_S

    def _begin_piece(self) -> None:
        if self._is_broken:
            self._session = secrets.token_hex(8)
        self._tried_s = self._began_s = self._clock()
        self._of_piece, self._dropped = self._messages, self.writer.dropped
        self._changed.clear()
        documents = {site.id: site.store.document for site in self._sites}
        defaults = {site.id: site.store.default_settings.model_dump(mode="json") for site in self._sites}
        self._begin = _Begin(
            t_ns=self._now_ns(),
            session=self._session,
            head=Head(self._metadata, documents, defaults, self._doubts()),
            layout="" if self._state is None else self._state.layout,
            snapshot=self._snapshot(),
        )
        self.writer.put(self._begin, 0)

    def _snapshot(self) -> Snapshot | None:
        """Return a copy of the state in memory that no other snapshot uses."""
        if self._state is None:
            return None
        self._state.keep_buffers_apart()
        found = self._state.snapshot()
        self._state.keep_buffers_apart()
        return found

    def _write(self, items: Sequence[BoxTurn | _Sync]) -> None:
        """Write the items. What the disk does not take is lost, and a new piece begins: a run must not skip anything.

        Old pieces make room first.
        """
        try:
            self._add(items)
            prune(self.folder, self._limits, self._now_ns(), None if self._piece is None else self._piece.path)
            if self._piece is not None:
                self._failed = None
        except OSError as error:
            self._give_up(error.strerror or str(error))
        finally:
            for item in items:
                if isinstance(item, _Sync):
                    item.is_done.set()

    def _add(self, items: Sequence[BoxTurn | _Sync]) -> None:
        turns = list[BoxTurn]()
        for item in items:
            if isinstance(item, BoxTurn):
                turns.append(item)
            elif isinstance(item, _Begin):
                self._add_turns(turns)
                turns = []
                self._open(item)
        self._add_turns(turns)

    def _open(self, begin: _Begin) -> None:
        self._close()
        self.folder.mkdir(parents=True, exist_ok=True)
        if lacks_room(self.folder) and not drop_oldest(self.folder, None):
            raise OSError(errno.ENOSPC, "the disk is nearly full")
        piece = OpenPiece(self.folder, begin.t_ns, begin.session)
        self._piece = piece
        self._state_bytes = self._making_room(lambda: piece.begin(begin.t_ns, begin.head, begin.layout, begin.snapshot))

    def _add_turns(self, turns: Sequence[BoxTurn]) -> None:
        piece = self._piece
        if piece is None or not turns:
            return
        rows = {message[0] for turn in turns for message in turn.messages}
        tags = {row: (self._sites.of_row(row).id, self._sites.rows.at(row).name) for row in rows}
        parts = encoded_turns(turns, tags)
        self._making_room(lambda: piece.add_turns(parts, turns[0].turn_ns, turns[-1].turn_ns))

    def _making_room(self, write: Callable[[], int | None]) -> int:
        """Write, and delete the oldest pieces while the disk takes nothing. Raises OSError."""
        while True:
            try:
                return write() or 0
            except OSError as error:
                is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
                if not (is_full and drop_oldest(self.folder, None if self._piece is None else self._piece.path)):
                    raise

    def _give_up(self, why: str) -> None:
        if self._failed is None:
            _log.warning("the black box cannot be written: %s", why)
        self._failed = f"the black box cannot be written: {why}"
        self._close()
        self._began_s = None

    def _close(self) -> None:
        if self._piece is not None:
            self._piece.close()
            self._piece = None
