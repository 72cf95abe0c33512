"""The times of a module become ours: evenly spaced, never in the future, whatever the delays."""

import itertools
import random

from dropanchor_tag_client.sources.modules.device_clock import DeviceClock

MS = 1_000_000
T0 = 1_760_000_000_000 * MS


def test_times_are_evenly_spaced_although_messages_come_in_bunches() -> None:
    clock, rng = DeviceClock(), random.Random(1)
    times = [clock.utc_ns(T0 + i * 10 * MS + rng.randrange(30 * MS), (5000 + 10 * i) * MS) for i in range(500)]
    gaps = [b - a for a, b in itertools.pairwise(times[100:])]
    assert max(gaps) - min(gaps) < MS


def test_no_time_is_later_than_the_arrival_of_its_message() -> None:
    clock, rng = DeviceClock(), random.Random(2)
    arrivals = [T0 + i * 10 * MS + rng.randrange(30 * MS) for i in range(500)]
    assert all(clock.utc_ns(arrival, 10 * i * MS) <= arrival for i, arrival in enumerate(arrivals))


def test_a_clock_that_drifts_is_followed() -> None:
    clock = DeviceClock()
    for i in range(60_000):  # ten minutes at 100 Hz, the module 50 ppm slow
        arrival = T0 + round(i * 10 * MS * (1 + 50e-6)) + (i % 7) * MS
        behind_ns = arrival - clock.utc_ns(arrival, 10 * i * MS)
    assert 0 <= behind_ns < 10 * MS


def test_a_module_that_starts_again_begins_anew() -> None:
    clock = DeviceClock()
    clock.utc_ns(T0, 1_000_000 * MS)
    assert clock.utc_ns(T0 + 5000 * MS, 12 * MS) == T0 + 5000 * MS
