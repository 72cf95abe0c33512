"""Say how far the clock of a tag's motion is ahead of that of its ranges.

One publisher may send the motion and another one the ranges, or one publisher may stamp both by clocks that differ.

The message with the least delay tells a clock best: its arrival minus the time of its newest sample is that delay minus
the error of the clock. The difference between two publishers is the offset of their clocks, if their least delays are
the same. Delays that stay long look like a clock that is behind.
"""

from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.kernels.clocks import EPOCH_NS
from dropanchor_service.ingest.kernels.sensor_clocks import BOTH, MOTION, RANGES
from dropanchor_service.ingest.kernels.sequences import NONE_NS


class Offsets(NamedTuple):
    """tags: indices. For each, offset_ns: of motion minus ranges, spread_ns: how much that has varied.

    moved_ns: what is added to the times of its motion.
    """

    tags: Array
    offset_ns: Array
    spread_ns: Array
    moved_ns: Array


def offsets_of(publishers: Array, now_ns: int) -> Offsets:
    """Return the offsets of the tags that have one.

    publishers: PUBLISHER, (tags, PER_TAG). These are the tags with a publisher of motion and another one of ranges,
    both heard in the last two epochs, and those whose only publisher stamps both kinds by clocks that differ.
    """
    least_ns = np.minimum(publishers["least_ns"], publishers["previous_least_ns"])
    heard = publishers["arrival_ns"] > now_ns - 2 * EPOCH_NS
    sent = np.where(heard & (least_ns != NONE_NS), publishers["kinds"] & BOTH, 0)
    of_motion, of_ranges = sent == MOTION, sent == RANGES
    apart = of_motion.any(axis=1) & of_ranges.any(axis=1)
    of_both = heard & (publishers["motion_shift_ns"] != 0) & (publishers["kinds"] & BOTH == BOTH)
    together = of_both.any(axis=1) & ~apart
    parts = _of_two(publishers, of_motion, of_ranges, apart), _of_one(publishers, of_both, together)
    return Offsets(*map(np.concatenate, zip(*parts, strict=True)))


def _of_two(publishers: Array, of_motion: Array, of_ranges: Array, wanted: Array) -> Offsets:
    tags = np.flatnonzero(wanted)
    offset_ns, spread_ns = np.zeros(len(tags), np.int64), np.zeros(len(tags), np.int64)
    moved_ns = np.zeros(len(tags), np.int64)
    for chosen, sign in ((of_motion, 1), (of_ranges, -1)):
        publisher = publishers[tags, _latest(publishers, chosen, tags)]
        least_ns, previous_ns = publisher["least_ns"], publisher["previous_least_ns"]
        own_ns = publisher["motion_shift_ns"] if sign == 1 else np.int64(0)
        offset_ns += sign * (publisher["shift_ns"] - np.minimum(least_ns, previous_ns) - own_ns)
        moved_ns += own_ns
        both = (least_ns != NONE_NS) & (previous_ns != NONE_NS)
        spread_ns += np.where(both, np.abs(least_ns - previous_ns), 0)
    return Offsets(tags, offset_ns, spread_ns, moved_ns)


def _of_one(publishers: Array, of_both: Array, wanted: Array) -> Offsets:
    tags = np.flatnonzero(wanted)
    publisher = publishers[tags, _latest(publishers, of_both, tags)]
    ahead_ns, moved_ns = publisher["ahead_ns"], publisher["motion_shift_ns"]
    return Offsets(tags, ahead_ns, np.abs(ahead_ns + moved_ns), moved_ns)


def _latest(publishers: Array, chosen: Array, tags: Array) -> Array:
    """Return the index, within each tag, of the chosen publisher that was heard last."""
    latest: Array = np.where(chosen, publishers["arrival_ns"], -1)[tags].argmax(axis=1)
    return latest
