"""Clocks of tags that are wrong or jump: their samples go on at the time at which they were taken."""

import time

import numpy as np
import pytest

from dropanchor_service.ingest.kernels.packed import FORM
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.runtime.clock import UtcClock

S = 1_000_000_000
MS = 1_000_000
HOUR = 3600 * S
T = 1_760_000_000 * S


class Tag:
    """A publisher that sends ten messages a second over a network that delays them."""

    def __init__(self, boot_clock: bool = False) -> None:
        self._publishers = Publishers()
        self._boot_clock = boot_clock
        self._sequence = 0
        self.jumps = 0

    def send(self, true_ns: int, error_ns: int, delay_ns: int = 20 * MS) -> int:
        """One message from a clock with this error; returns the error of the time that it gets."""
        form, zero = np.zeros(1, FORM), np.zeros(1, np.int32)
        form["accepted"] = form["numbered"] = True
        form["boot_id"], form["sequence"], form["boot_clock"] = 5, self._sequence, self._boot_clock
        self._sequence += 1
        arrival = np.array([true_ns + delay_ns])
        sequenced = self._publishers.sequence(form, zero, arrival, 0)
        own_ns = true_ns + error_ns
        offsets, jumps = self._publishers.utc_offsets(form, sequenced, arrival, [(zero, np.array([own_ns]))])
        self.jumps += jumps
        return own_ns + int(offsets.sum()) - true_ns

    def errors(self, begin_s: float, end_s: float, error_ns: int) -> list[int]:
        delays = (5 * MS, 40 * MS, 15 * MS)
        steps = range(round(begin_s * 10), round(end_s * 10))
        return [self.send(T + step * S // 10, error_ns, delays[step % 3]) for step in steps]


@pytest.mark.parametrize("jump_ns", [HOUR, -HOUR, -T])
def test_a_clock_that_jumps_goes_on_within_a_delay_and_is_right_again_when_it_is_set_right(jump_ns: int) -> None:
    tag = Tag()
    assert set(tag.errors(0, 5, 0)) == {0}
    assert max(map(abs, tag.errors(5, 10, jump_ns))) < 100 * MS
    assert tag.jumps == 1
    assert set(tag.errors(10, 15, 0)) == {0}
    assert tag.jumps == 2


@pytest.mark.parametrize("error_ns", [HOUR, -T])
def test_a_clock_that_is_ahead_or_was_never_set_is_taken_by_arrival_until_it_is_set(error_ns: int) -> None:
    tag = Tag()
    assert max(map(abs, tag.errors(0, 5, error_ns))) < 100 * MS
    assert set(tag.errors(5, 10, 0)) == {0}


def test_a_backlog_of_minutes_is_late_and_not_wrong() -> None:
    tag = Tag()
    assert set(tag.errors(0, 1, 0)) == {0}
    late = [tag.send(T + S + step * S // 10, 0, delay_ns=300 * S - step * 90 * MS) for step in range(3000)]
    assert set(late) == {0}
    assert tag.jumps == 0


def test_a_step_of_a_second_is_left_alone() -> None:
    tag = Tag()
    tag.errors(0, 2, 0)
    assert set(tag.errors(2, 4, -S)) == {-S}
    assert set(tag.errors(4, 6, S)) == {S}
    assert tag.jumps == 0


def test_a_boot_clock_that_starts_again_is_mapped_anew_at_once() -> None:
    tag = Tag(boot_clock=True)
    assert max(map(abs, tag.errors(0, 5, -T))) < 50 * MS
    assert max(map(abs, tag.errors(5, 8, -T - 5 * S))) < 50 * MS


def test_steps_of_the_host_do_nothing_to_our_own_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = UtcClock()
    before = clock.now_ns()
    for step_ns in (24 * HOUR, -24 * HOUR):
        stepped = time.time_ns() + step_ns
        with monkeypatch.context() as host:
            host.setattr(time, "time_ns", lambda stepped=stepped: stepped)
            host.setattr(time, "time", lambda stepped=stepped: stepped * 1e-9)
            assert 0 <= clock.now_ns() - before < 60 * S
