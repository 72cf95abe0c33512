"""The offset between the clocks of a tag's motion and its ranges shows from the messages with the least delay."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from dropanchor_service.ingest.decode import Forms
from dropanchor_service.ingest.kernels.packed import FORM
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.publishers import Publishers

S = 1_000_000_000
MS = 1_000_000
T = 1_760_000_000 * S
IMU, RANGE = 0, 1
DELAYS = (80 * MS, 5 * MS, 300 * MS)


@dataclass
class Tag:
    """Publishers of one tag, which send ten messages a second over a network that delays them."""

    publishers: Publishers = field(default_factory=Publishers)
    sent: dict[int, int] = field(default_factory=dict)

    def send(
        self, boot_id: int, kinds: tuple[int, ...], true_ns: int, error_ns: int = 0, delay_ns: int = 0, **form: bool
    ) -> None:
        """Send a message with a sample of each kind, from a clock with this error."""
        forms, zero = np.zeros(1, FORM), np.zeros(1, np.int32)
        forms["accepted"] = forms["numbered"] = True
        forms["boot_id"], forms["sequence"] = boot_id, self.sent.get(boot_id, 0)
        forms["kinds"] = sum(1 << kind for kind in kinds)
        for name, value in form.items():
            forms[name] = value
        self.sent[boot_id] = self.sent.get(boot_id, 0) + 1
        arrival = np.array([true_ns + delay_ns])
        messages = Messages(Forms(forms), zero, arrival, waited=1)
        sequenced = self.publishers.sequence(messages, 0)
        times = [
            (zero, np.array([true_ns + error_ns])) if kind in kinds else (zero[:0], arrival[:0]) for kind in range(2)
        ]
        self.publishers.time_offsets(messages, sequenced, times, true_ns + delay_ns)

    def send_apart(self, seconds: float, error_ns: int, begin_s: float = 0.0, **form: bool) -> None:
        """Send motion from a clock with this error, and ranges from one that is right."""
        for step in range(round(seconds * 10)):
            true_ns = T + round(begin_s * S) + step * S // 10
            self.send(1, (IMU,), true_ns, error_ns, DELAYS[step % 3], **form)
            self.send(2, (RANGE,), true_ns, 0, DELAYS[(step + 1) % 3])

    def offset_s(self, at_s: float) -> float | None:
        now_ns = T + round(at_s * S)
        found = self.publishers.clock_offset(0, now_ns)
        every = self.publishers.clock_offsets(now_ns)
        assert every == ({} if found is None else {0: found})
        return None if found is None else found.offset_s


@pytest.mark.parametrize("error_s", [0.8, 0.0, -0.8, -1.5])
def test_the_offset_is_that_of_the_clocks_whatever_the_other_delays(error_s: float) -> None:
    tag = Tag()
    tag.send_apart(5, round(error_s * S))
    assert tag.offset_s(5) == pytest.approx(error_s, abs=1e-6)


def test_a_clock_that_was_set_right_shows_within_a_minute() -> None:
    tag = Tag()
    tag.send_apart(40, 800 * MS)
    tag.send_apart(61, 0, begin_s=40)
    assert tag.offset_s(101) == pytest.approx(0.0, abs=1e-6)


def test_a_clock_that_wanders_is_less_certain() -> None:
    tag = Tag()
    tag.send_apart(29, 800 * MS)
    steady = tag.publishers.clock_offset(0, T + 29 * S)
    tag.send_apart(29, 700 * MS, begin_s=31)
    wandering = tag.publishers.clock_offset(0, T + 60 * S)
    assert steady is not None
    assert wandering is not None
    assert steady.is_too_large
    assert wandering.uncertainty_s == pytest.approx(steady.uncertainty_s + 0.1, abs=1e-6)


def test_a_clock_that_counts_from_a_start_is_aligned_by_its_messages() -> None:
    tag = Tag()
    tag.send_apart(5, 5 * S - T, boot_clock=True)
    offset_s = tag.offset_s(5)
    assert offset_s is not None
    assert abs(offset_s) < 0.1


@pytest.mark.parametrize("jump_s", [3600, -3600])
def test_a_clock_whose_jump_was_removed_has_no_offset_of_an_hour(jump_s: int) -> None:
    tag = Tag()
    tag.send_apart(5, 0)
    tag.send_apart(5, jump_s * S, begin_s=5)
    offset_s = tag.offset_s(10)
    assert offset_s is not None
    assert abs(offset_s) < 0.1


def test_there_is_no_offset_where_one_program_sends_both_or_one_side_is_missing_silent_or_replayed() -> None:
    both, motion_alone, silent, replayed = Tag(), Tag(), Tag(), Tag()
    for step in range(20):
        both.send(1, (IMU, RANGE), T + step * S // 10)
        both.send(2, (RANGE,), T + step * S // 10)
        motion_alone.send(1, (IMU,), T + step * S // 10)
    silent.send_apart(2, 0)
    replayed.send_apart(2, -3600 * S, replay=True)
    assert both.offset_s(2) is motion_alone.offset_s(2) is replayed.offset_s(2) is None
    assert silent.offset_s(2) is not None
    assert silent.offset_s(63) is None
    assert Publishers().clock_offset(0, T) is None
