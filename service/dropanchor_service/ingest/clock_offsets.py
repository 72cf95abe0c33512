"""Compare the clocks of two publishers of one tag, of which one sends motion and the other one ranges.

The message with the least delay tells a clock best: its arrival minus the time of its newest sample is that delay minus
the error of the clock. The difference between two publishers is the offset of their clocks, if their least delays are
the same. Delays that stay long look like a clock that is behind.
"""

import numpy as np

from dropanchor_schemas.kinds import IMU, KINDS
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.kernels.clocks import EPOCH_NS
from dropanchor_service.ingest.kernels.sequences import NONE_NS

_BIT_OF = {kind.name: 1 << index for index, kind in enumerate(KINDS)}
_MOTION, _RANGE = _BIT_OF[IMU.name], _BIT_OF["range"]


def offsets_of(publishers: Array, now_ns: int) -> tuple[Array, Array, Array]:
    """Return indices of tags, and for each the offset of motion minus ranges and how much that has varied, ns.

    publishers: PUBLISHER, (tags, PER_TAG). Only tags with a publisher of motion and another one of ranges, both heard
    in the last two epochs, have an offset.
    """
    least_ns = np.minimum(publishers["least_ns"], publishers["previous_least_ns"])
    known = (least_ns != NONE_NS) & (publishers["arrival_ns"] > now_ns - 2 * EPOCH_NS)
    sent = np.where(known, publishers["kinds"] & (_MOTION | _RANGE), 0)
    of_motion, of_ranges = sent == _MOTION, sent == _RANGE
    tags = np.flatnonzero(of_motion.any(axis=1) & of_ranges.any(axis=1))
    offset_ns, spread_ns = np.zeros(len(tags), np.int64), np.zeros(len(tags), np.int64)
    for chosen, sign in ((of_motion, 1), (of_ranges, -1)):
        latest = np.where(chosen, publishers["arrival_ns"], -1)[tags].argmax(axis=1)
        publisher = publishers[tags, latest]
        offset_ns += sign * (publisher["shift_ns"] - least_ns[tags, latest])
        both = (publisher["least_ns"] != NONE_NS) & (publisher["previous_least_ns"] != NONE_NS)
        spread_ns += np.where(both, np.abs(publisher["least_ns"] - publisher["previous_least_ns"]), 0)
    return tags, offset_ns, spread_ns
