"""Track each publisher of a tag: which of its messages have arrived, in which order, and its clock."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.ingest.clock_offsets import offsets_of
from dropanchor_service.ingest.corrections import differences, errors, follow_lag, move
from dropanchor_service.ingest.kernels import sequences
from dropanchor_service.ingest.kernels.clocks import TAG_TIME, time_offsets
from dropanchor_service.ingest.kernels.sequences import PER_TAG, PUBLISHER, WINDOW
from dropanchor_service.ingest.kernels.utc_clocks import DOUBTED_NS, WATCH
from dropanchor_service.ingest.kernels.values import newest_times
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.motion_offsets.watch import MotionOffsets
from dropanchor_service.store.clock_offsets import LEAST_DELAYS_S, ClockOffset
from dropanchor_service.store.records import enlarged

WATCH_NS = 5_000_000_000  # time between two searches for tags with two publishers
_NONE = np.zeros(0, np.int64)


class Sequenced(NamedTuple):
    """The result of `Publishers.sequence`, as indices of messages.

    due: to fuse now, in this order. pending: to pass in again, before newer messages, until they are due. duplicates:
    arrived before. missing: number of messages that are given up. restarts: number of times that a publisher began to
    count from another number. slots: publisher of each message, -1 for none.
    """

    due: Array
    pending: Array
    duplicates: Array
    missing: int
    restarts: int
    slots: Array


class TimeOffsets(NamedTuple):
    """What to add to the times of messages, ns; an array is empty if all of it is 0. motion: to those of IMU samples.

    jumps: how many clocks jumped. restarts: indices of messages from which on the motion is of an earlier time.
    doubted: indices in `Publishers.columns` of publishers that show that their clock, or that of the host, is off.
    doubtful: indices of messages whose clock was set, or that begin a backlog; see `is_doubtful`.
    """

    messages: Array
    motion: Array
    jumps: int
    restarts: Array
    doubted: Array
    doubtful: Array


class SequenceState(NamedTuple):
    """next: the expected number. seen: bit n % WINDOW is set if message n has arrived."""

    next: int
    seen: int

    def ahead(self, sequence: int) -> int:
        """Return how far a number is ahead of the expected one; negative if it is behind."""
        return (sequence - self.next + 2**31) % 2**32 - 2**31

    def has(self, sequence: int) -> bool:
        """Return whether this message was fused before, or is older than the window of remembered numbers."""
        behind = -self.ahead(sequence)
        return behind > 0 and (behind > WINDOW or bool(self.seen >> sequence % WINDOW & 1))


class Publishers:
    """The last few publishers of every tag. Memory stays bounded, whatever boot ids a tag makes up.

    `columns` and `times` are the whole state: a checkpoint is a copy of them. After a restore, each publisher is
    expected to continue after its last fused number. Messages from caches fill the gap, if `due_ns` of `sequence`
    leaves them enough time.
    """

    def __init__(self) -> None:
        self._columns = np.zeros(0, PUBLISHER)
        self._times = np.zeros(0, TAG_TIME)
        self.watches = np.zeros(0, WATCH)  # of each publisher
        self.estimated = np.zeros(0, np.int64)  # newest of the estimator's times of each tag; 0: none yet
        self._motion_offsets = MotionOffsets()
        self._watched_ns = 0

    @property
    def columns(self) -> Array:
        """PUBLISHER, PER_TAG for each row of a tag."""
        return self._columns

    @columns.setter
    def columns(self, columns: Array) -> None:
        self._columns = columns.copy()
        self.watches = np.zeros(len(columns), WATCH)
        self.estimated = np.zeros(len(columns) // PER_TAG, np.int64)

    @property
    def times(self) -> Array:
        """TAG_TIME for each row of a tag."""
        return self._times

    @times.setter
    def times(self, times: Array) -> None:
        self._times = times.copy()

    def sequence(self, messages: Messages, due_ns: int | Array) -> Sequenced:
        """Put messages into the order of their publishers.

        due_ns: of all or of each: give up on messages that are missing before one that arrived by then. What is missing
        before a fresh one is not given up, since the caches may have it.
        """
        forms, rows, arrivals = messages.read.forms, messages.rows, messages.arrived
        self._grow(rows)
        n = len(rows)
        slots, distances, verdicts = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.uint8)
        pending = sequences.pass_in_order(forms, rows, arrivals, self._columns, slots, distances, verdicts)
        restarts = np.count_nonzero((abs(distances) > WINDOW) & (verdicts == sequences.PASS))
        due = np.flatnonzero(verdicts == sequences.PASS)
        missing = 0
        if pending:
            behind = np.flatnonzero(verdicts == sequences.PENDING)
            ordered = behind[np.lexsort((distances[behind], slots[behind]))]
            due_of = np.full(n, due_ns, np.int64)
            missing = sequences.release(
                ordered, slots, forms, arrivals, self._columns, due_of, messages.waited, verdicts
            )
            due = np.concatenate([due, ordered[verdicts[ordered] == sequences.PASS]])
        again, waiting = (np.flatnonzero(verdicts == which) for which in (sequences.DUPLICATE, sequences.PENDING))
        return Sequenced(due, waiting, again, missing, int(restarts), slots)

    def sequence_states(self, row: int) -> dict[int, SequenceState]:
        """Return the state of each publisher of this tag, by boot id."""
        of_tag = self._columns[row * PER_TAG : (row + 1) * PER_TAG]
        return {
            int(publisher["boot_id"]): SequenceState(
                int(publisher["next"]), int.from_bytes(publisher["seen"].astype("<u8").tobytes(), "little")
            )
            for publisher in of_tag[of_tag["status"] == sequences.RUNNING]
        }

    def allow_gap(self, rows: Array) -> None:
        """Do not wait for the next missing messages of these rows, because the buffer has shed them."""
        known = rows[(rows + 1) * PER_TAG <= len(self._columns)]
        self._columns["gap_allowed"].reshape(-1, PER_TAG)[known] = True

    def time_offsets(
        self, messages: Messages, sequenced: Sequenced, samples: Sequence[tuple[Array, Array]], now_ns: int
    ) -> TimeOffsets:
        """Return the estimator's time minus the publisher's clock for each message.

        samples: for each of `KINDS`, the index of the message and the time of every sample.
        """
        forms, n = messages.read.forms, len(messages.rows)
        newest, counts = np.full((n, 3), -1, np.int64), np.zeros((n, 3), np.int64)
        offsets, motion = np.zeros(n, np.int64), np.zeros(n, np.int64)
        restarts, doubted, doubtful = np.zeros((3, n), bool)
        for kind, (indices, t_ns) in enumerate(samples):
            if len(t_ns):
                newest_times(t_ns, indices, kind, newest, counts)
        jumps = time_offsets(
            *(forms, sequenced.slots, newest, counts, messages.arrived, sequenced.due, self._columns, self._times),
            *(self.watches, self.estimated, now_ns, offsets, motion, restarts, doubted, doubtful),
        )
        used = offsets if offsets.any() else _NONE
        of_motion = offsets + motion if motion.any() else used
        went_back, in_doubt = (np.flatnonzero(some) if some.any() else _NONE for some in (restarts, doubtful))
        of_doubted = sequenced.slots[doubted] if doubted.any() else _NONE
        return TimeOffsets(used, of_motion, jumps, went_back, of_doubted, in_doubt)

    def is_doubtful(self, slot: int) -> bool:
        """Return whether it is not known yet that the clock of a publisher was set, or that it sends a backlog."""
        watch, arrival_ns = self.watches[slot], self._columns["arrival_ns"][slot]
        sends_backlogs = watch["doubted_ns"] != 0 and arrival_ns - watch["doubted_ns"] < DOUBTED_NS
        return bool(watch["back_ns"] != 0 and not sends_backlogs)

    def offset_ns(self, slot: int) -> int:
        """Return the estimator's time minus the clock of a publisher, ns."""
        return int(self._columns["shift_ns"][slot] - self._times["correction_ns"][slot // PER_TAG])

    def compare_clocks(self, samples: SampleBatch, now_ns: int) -> None:
        """Use the samples of tags whose motion and ranges come from two publishers to compare their clocks."""
        if abs(now_ns - self._watched_ns) >= WATCH_NS:
            self._watched_ns = now_ns
            found = offsets_of(self._columns.reshape(-1, PER_TAG), now_ns)
            self._motion_offsets.watch(dict(zip(found.tags.tolist(), found.moved_ns.tolist(), strict=True)))
        self._motion_offsets.add(samples)

    def clock_offset(self, row: int, now_ns: int) -> ClockOffset | None:
        """Return how far the clock of a tag's motion is ahead of that of its ranges, None if that is not known."""
        return self._clock_offsets(row, row + 1, now_ns).get(row)

    def clock_offsets(self, now_ns: int) -> dict[int, ClockOffset]:
        """Return the offset of each row for which it is known."""
        return self._clock_offsets(0, len(self._times), now_ns)

    def _clock_offsets(self, first: int, end: int, now_ns: int) -> dict[int, ClockOffset]:
        found = offsets_of(self._columns[first * PER_TAG : end * PER_TAG].reshape(-1, PER_TAG), now_ns)
        columns = (found.tags + first, found.offset_ns * 1e-9, found.spread_ns * 1e-9, found.moved_ns != 0)
        return {
            row: ClockOffset(offset_s, LEAST_DELAYS_S + spread_s, self._motion_offsets.offset(row), corrected)
            for row, offset_s, spread_s, corrected in zip(*(column.tolist() for column in columns), strict=True)
        }

    def differences(self, now_ns: int) -> dict[int, int]:
        """Return, by row, by how much our clock is ahead of that of a tag, ns. Tags that are not live are left out."""
        return differences(self._columns, self.watches, now_ns)

    def clock_errors(self, now_ns: int) -> dict[int, float]:
        """Return, by row, how far the clock of a tag is ahead of ours, s, where that is corrected."""
        return errors(self._columns, now_ns)

    def follow_lags(self, slots: Array) -> None:
        """Correct the times of these publishers, if they are always late by the same."""
        for slot in slots.tolist():
            follow_lag(slot, self._columns, self._times, self.watches, self.estimated)

    def move(self, by_ns: int) -> None:
        """Follow our clock, which was moved, so that the times of the estimators go on."""
        self._watched_ns += by_ns
        move(self._columns, self._times, by_ns)
        self.watches[:] = 0

    def to_utc(self, outcomes: Array) -> None:
        """Convert the times of POSE or INNOVATION from the estimators' time to UTC, in place."""
        if self._times["correction_ns"].any():
            known = outcomes["row"] < len(self._times)
            outcomes["t_ns"][known] += self._times["correction_ns"][outcomes["row"][known]]

    def _grow(self, rows: Array) -> None:
        needed = (int(rows.max(initial=-1)) + 1) * PER_TAG
        if needed > len(self._columns):
            self._columns = enlarged(self._columns, max(needed, 2 * len(self._columns)))
            self._times = enlarged(self._times, len(self._columns) // PER_TAG)
            self.watches = enlarged(self.watches, len(self._columns))
            self.estimated = enlarged(self.estimated, len(self._times))
