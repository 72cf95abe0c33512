"""Samples of tags whose clocks are wrong or jump keep the time at which they were taken."""

import random
import time
from itertools import pairwise

import numpy as np
import pytest

from dropanchor_service.ingest.decode import Forms
from dropanchor_service.ingest.kernels.packed import FORM
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.runtime.clock import UtcClock

S = 1_000_000_000
MS = 1_000_000
HOUR = 3600 * S
T = 1_760_000_000 * S


class Tag:
    """A publisher that sends ten messages a second over a network that delays them."""

    def __init__(self, boot_clock: bool = False, boot_id: int = 5, publishers: Publishers | None = None) -> None:
        self._publishers = publishers or Publishers()
        self._boot_clock = boot_clock
        self._boot_id = boot_id
        self._sequence = 0
        self.jumps = 0
        self.estimator_ns = 0  # time of the last message for the estimator

    def another(self, boot_id: int) -> "Tag":
        """Return a second publisher of the same tag."""
        return Tag(self._boot_clock, boot_id, self._publishers)

    def send(self, true_ns: int, error_ns: int, delay_ns: int = 20 * MS) -> int:
        """Send a message from a clock with this error. Return the error of the time that its pose gets."""
        form, zero = np.zeros(1, FORM), np.zeros(1, np.int32)
        form["accepted"] = form["numbered"] = True
        form["boot_id"], form["sequence"], form["boot_clock"] = self._boot_id, self._sequence, self._boot_clock
        self._sequence += 1
        arrival = np.array([true_ns + delay_ns])
        messages = Messages(Forms(form), zero, arrival, waited=1)
        sequenced = self._publishers.sequence(messages, 0)
        own_ns = true_ns + error_ns
        offsets = self._publishers.time_offsets(messages, sequenced, [(zero, np.array([own_ns]))], int(arrival[0]))
        self.jumps += offsets.jumps
        self.estimator_ns = own_ns + int(offsets.messages.sum())
        pose = np.array([(0, self.estimator_ns)], [("row", "i4"), ("t_ns", "i8")])
        self._publishers.to_utc(pose)
        return int(pose["t_ns"][0]) - true_ns

    def errors(self, begin_s: float, end_s: float, error_ns: int) -> list[int]:
        """Send messages for some seconds. Return the errors of their times, ns."""
        delays = (5 * MS, 40 * MS, 15 * MS)
        steps = range(round(begin_s * 10), round(end_s * 10))
        return [self.send(T + step * S // 10, error_ns, delays[step % 3]) for step in steps]


@pytest.mark.parametrize("jump_ns", [HOUR, -HOUR, -T])
def test_times_of_a_clock_that_jumps_stay_within_a_delay_and_are_exact_once_it_is_set_right(jump_ns: int) -> None:
    tag = Tag()
    assert set(tag.errors(0, 5, 0)) == {0}
    errors = tag.errors(5, 10, jump_ns)
    doubted = 5 if jump_ns == -HOUR else 0  # for half a second it may be a backlog
    assert set(errors[:doubted]) <= {jump_ns}
    assert max(map(abs, errors[doubted:])) < 100 * MS
    assert tag.jumps == 1
    assert set(tag.errors(10, 15, 0)) == {0}
    assert tag.jumps == 2


@pytest.mark.parametrize("error_ns", [HOUR, -9 * 365 * 24 * HOUR])
def test_times_of_a_clock_that_is_ahead_or_years_behind_follow_the_arrival_until_it_is_set(error_ns: int) -> None:
    tag = Tag()
    assert max(map(abs, tag.errors(0, 5, error_ns))) < 100 * MS
    assert set(tag.errors(5, 10, 0)) == {0}


def test_a_clock_that_begins_before_2015_is_not_believed_and_one_that_was_right_before_goes_on() -> None:
    tag = Tag()
    assert set(tag.errors(0, 2, -T)) == {-T}
    assert set(tag.errors(2, 4, 0)) == {0}
    assert max(map(abs, tag.errors(4, 6, -T))) < 100 * MS
    assert tag.jumps == 1


@pytest.mark.parametrize("unit_ns", [S, 10**6, 10**3])
def test_a_publisher_that_changes_to_another_unit_is_not_taken_for_a_clock_that_was_reset(unit_ns: int) -> None:
    tag = Tag()
    tag.errors(0, 2, 0)
    for step in range(20, 30):
        true_ns = T + step * S // 10
        error_ns = true_ns // unit_ns - true_ns
        assert tag.send(true_ns, error_ns) == error_ns
    assert set(tag.errors(3, 4, 0)) == {0}
    assert tag.jumps == 0


def test_a_backlog_of_minutes_is_no_clock_error() -> None:
    tag = Tag()
    assert set(tag.errors(0, 1, 0)) == {0}
    late = [tag.send(T + S + step * S // 10, 0, delay_ns=300 * S - step * 90 * MS) for step in range(3000)]
    assert set(late) == {0}
    assert tag.jumps == 0


def test_a_step_of_a_second_is_not_corrected() -> None:
    tag = Tag()
    tag.errors(0, 2, 0)
    assert set(tag.errors(2, 4, -S)) == {-S}
    assert set(tag.errors(4, 6, S)) == {S}
    assert tag.jumps == 0


def test_a_boot_clock_that_restarts_is_mapped_again_at_once() -> None:
    tag = Tag(boot_clock=True)
    assert max(map(abs, tag.errors(0, 5, -T))) < 50 * MS
    assert max(map(abs, tag.errors(5, 8, -T - 5 * S))) < 50 * MS


@pytest.mark.parametrize("ppm", [50, -50])
def test_a_drifting_boot_clock_is_followed_within_milliseconds_and_its_intervals_stay(ppm: int) -> None:
    tag, dice = Tag(boot_clock=True), random.Random(5)
    errors, times = list[int](), list[int]()
    for step in range(36_000):
        own_ns = step * S // 10 + step * ppm * 100
        delay_ns = dice.choice((5, 6, 40, 400)) * MS
        errors.append(tag.send(T + step * S // 10, own_ns - T - step * S // 10, delay_ns))
        times.append(tag.estimator_ns - own_ns)
    assert max(abs(error - 5 * MS) for error in errors[2400:]) < 7 * MS
    assert len(set(times)) == 1
    assert tag.jumps == 0


def test_a_late_first_message_is_corrected_gradually() -> None:
    tag = Tag(boot_clock=True)
    errors = [tag.send(T, -T, 200 * MS)]
    errors += [tag.send(T + step * S // 10, -T, 5 * MS) for step in range(1, 1200)]
    assert min(after - before for before, after in pairwise(errors)) == -MS
    assert errors[0] == 200 * MS
    assert errors[210] <= 26 * MS
    assert errors[-1] == 8 * MS
    assert tag.jumps == 0


def test_a_second_boot_clock_of_a_tag_is_mapped_to_the_time_of_the_first() -> None:
    first = Tag(boot_clock=True)
    second = first.another(boot_id=6)
    first.send(T, -T, 100 * MS)
    apart = []
    for step in range(1, 6000):
        true_ns = T + step * S // 10
        first.send(true_ns, -T, 5 * MS)
        second.send(true_ns, 7 * S - T, 5 * MS)
        apart.append(second.estimator_ns - first.estimator_ns)
    assert abs(apart[0]) <= 100 * MS
    assert abs(apart[-1]) <= 3 * MS


def test_another_boot_clock_becomes_the_reference_when_the_first_falls_silent() -> None:
    first = Tag(boot_clock=True)
    second = first.another(boot_id=6)
    first.send(T, -T)
    second.send(T, 7 * S - T, 100 * MS)
    times = []
    for step in range(700, 2400):
        error_ns = second.send(T + step * S // 10, 7 * S - T, 5 * MS)
        times.append(second.estimator_ns - step * S // 10)
    assert error_ns == 8 * MS
    assert len(set(times)) == 1


def test_a_very_late_first_message_is_corrected_by_the_second_at_once() -> None:
    tag = Tag(boot_clock=True)
    assert tag.send(T, -T, 10 * S) == 10 * S
    assert tag.send(T + S, -T, 5 * MS) == 5 * MS
    assert tag.jumps == 1


def test_a_boot_clock_that_stood_still_is_mapped_again_within_two_minutes() -> None:
    tag = Tag(boot_clock=True)
    assert set(tag.errors(0, 100, -T)) == {5 * MS}
    errors = tag.errors(120, 320, -T - 20 * S)
    assert errors[0] == 5 * MS - 20 * S
    assert set(errors[900:]) == {5 * MS}
    assert tag.jumps == 1


def test_a_backlog_that_shrinks_for_minutes_does_not_move_a_boot_clock() -> None:
    tag = Tag(boot_clock=True)
    first = tag.errors(0, 100, -T)
    late = [tag.send(T + (1000 + step) * S // 10, -T, 300 * S - step * 90 * MS) for step in range(3000)]
    assert {*first, *late} == {5 * MS}
    assert tag.jumps == 0


def test_steps_of_the_host_clock_do_not_change_our_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = UtcClock()
    before = clock.now_ns()
    for step_ns in (24 * HOUR, -24 * HOUR):
        stepped = time.time_ns() + step_ns
        with monkeypatch.context() as host:
            host.setattr(time, "time_ns", lambda stepped=stepped: stepped)
            host.setattr(time, "time", lambda stepped=stepped: stepped * 1e-9)
            assert 0 <= clock.now_ns() - before < 60 * S
