"""Correct clocks that should be UTC. PUBLISHER, TAG_TIME and WATCH are those of the kernels."""

import numpy as np

from dropanchor_schemas.times import EARLIEST_UTC_NS
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.kernels.clocks import EPOCH_NS
from dropanchor_service.ingest.kernels.sequences import NONE_NS, PER_TAG
from dropanchor_service.ingest.kernels.utc_clocks import LATE_NS, NEAR_NS, PERIOD_NS


def least_differences(watches: Array) -> Array:
    """Return the least difference of each WATCH in its last two periods, NONE_NS without one."""
    least: Array = np.minimum(watches["least_ns"], watches["previous_ns"])
    return np.where(watches["begun_ns"] != 0, least, NONE_NS)


def differences(publishers: Array, watches: Array, now_ns: int) -> dict[int, int]:
    """Return by row what our clock is ahead of that of a tag: of its publishers the one that is nearest to ours."""
    least_ns = least_differences(watches)
    heard = (publishers["arrival_ns"] > now_ns - 2 * PERIOD_NS) & (publishers["newest_ns"] >= EARLIEST_UTC_NS)
    known = np.flatnonzero(heard & (least_ns != NONE_NS))
    nearest = known[np.argsort(-np.abs(least_ns[known]), kind="stable")]  # in a dictionary, the last one stays
    return dict(zip((nearest // PER_TAG).tolist(), least_ns[nearest].tolist(), strict=True))


def errors(publishers: Array, now_ns: int) -> dict[int, float]:
    """Return by row how far the clock of a tag is ahead of ours, s; without those that are right or count from boot."""
    heard = (publishers["arrival_ns"] > now_ns - 2 * EPOCH_NS) & (publishers["newest_ns"] >= EARLIEST_UTC_NS)
    off = np.flatnonzero(heard & (np.abs(publishers["shift_ns"]) > NEAR_NS))
    latest = off[np.argsort(publishers["arrival_ns"][off], kind="stable")]
    return dict(zip((latest // PER_TAG).tolist(), (publishers["shift_ns"][latest] * -1e-9).tolist(), strict=True))


def follow_lag(slot: int, publishers: Array, times: Array, watches: Array, estimated: Array) -> None:
    """Correct the times of a publisher that is always late by the same, and of those of its tag that are as late.

    The estimator's time goes on: what changes is the UTC of its poses, unless it has seen later times.
    """
    row = slot // PER_TAG
    of_tag = slice(row * PER_TAG, (row + 1) * PER_TAG)
    least_ns, shift_ns = least_differences(watches[of_tag]), publishers["shift_ns"][of_tag]
    wanted_ns, before_ns = int(least_ns[slot % PER_TAG]), int(shift_ns[slot % PER_TAG])
    if wanted_ns == NONE_NS or wanted_ns - before_ns <= LATE_NS:
        return
    alike = (np.abs(least_ns - wanted_ns) <= NEAR_NS) & (shift_ns == before_ns)
    shift_ns[alike] = wanted_ns
    for name, value in (("least_ns", NONE_NS), ("previous_least_ns", NONE_NS), ("epoch_end_ns", 0)):
        publishers[name][of_tag][alike] = value
    moved_ns = int(publishers["newest_ns"][slot]) + before_ns - int(times["correction_ns"][row])
    if abs(moved_ns - estimated[row]) < abs(moved_ns + wanted_ns - before_ns - estimated[row]):
        times["correction_ns"][row] += wanted_ns - before_ns


def move(publishers: Array, times: Array, by_ns: int) -> None:
    """Move all arrivals, and what maps times to UTC. A clock that agrees with ours then needs no shift."""
    for name in ("used_ns", "arrival_ns", "epoch_end_ns", "period_ns"):
        publishers[name][publishers[name] != 0] += by_ns
    for name in ("least_ns", "previous_least_ns", "delay_ns"):
        publishers[name][publishers[name] != NONE_NS] += by_ns
    late_ns, shift_ns = publishers["arrival_ns"] - publishers["newest_ns"], publishers["shift_ns"].copy()
    is_right = (late_ns >= -NEAR_NS) & (late_ns <= LATE_NS)
    off = shift_ns != 0
    publishers["shift_ns"][off] = np.where(is_right, 0, shift_ns + by_ns)[off]
    changed_ns = (publishers["shift_ns"] - shift_ns).reshape(-1, PER_TAG)
    newest = np.where(changed_ns != 0, publishers["arrival_ns"].reshape(-1, PER_TAG), -1).argmax(axis=1)
    times["correction_ns"] += changed_ns[np.arange(len(times)), newest]
