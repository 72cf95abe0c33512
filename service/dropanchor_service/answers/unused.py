"""Say which of a tag's last samples were not used, and why: from what arrived, not from what the estimate shows."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from dropanchor_schemas.rejections import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.rows import KINDS, MESSAGE, REASONS, SCREENED
from dropanchor_service.store.tags import TagTable

NOT_USED: Final = "{0} of its last {1} {2} were not used: {3}."
NOUNS: Final = {
    "imu": "IMU samples",
    "range": "ranges",
    "heading": "headings",
    "bearing": "bearings",
    MESSAGE: "messages",
}
LEAST: Final = 3  # samples of a kind that say something
STILL_NS: Final = 5_000_000_000  # after such a silence the tag sends nothing that could be used
BEHIND_S: Final = 0.2

BEHIND: Final = "they are older than its IMU samples by {0} s, so check the clocks and the network of both devices"
OUT_OF_ORDER: Final = "newer ones came before them, so let the tag send them in order"
NOT_NUMBERS: Final = "they hold values that are not numbers"
WRONG_TIMES: Final = "their times are not UTC in nanoseconds"
STD_WRONG: Final = "their standard deviation is not one"
FAULT: Final = "the estimator failed on them, so look at the service's log"
DAMAGED: Final = "they are damaged, or not of this protocol"

_ANY: Final[dict[Reason, str | None]] = {
    Reason.LATE: OUT_OF_ORDER,
    Reason.NOT_FINITE: NOT_NUMBERS,
    Reason.STD_INVALID: STD_WRONG,
    Reason.TIME_OUT_OF_RANGE: WRONG_TIMES,
    Reason.TIME_NOT_UTC: WRONG_TIMES,
    Reason.ESTIMATOR_FAULT: FAULT,
    Reason.ANCHOR_UNKNOWN: None,  # its hint names the anchor
    Reason.SENSOR_FAULT: None,  # its hint names the sensor
}
WHY: Final[dict[str, dict[Reason, str | None]]] = {
    "imu": _ANY
    | {
        Reason.IMU_ABSURD: "no sensor measures such values, so send m/s² and rad/s",
        Reason.TIME_REPEATED: "several have the same time, so send each with its own time",
        Reason.IMU_STUCK: "they are equal to the last bit, so restart the sensor that repeats itself",
    },
    "range": _ANY
    | {
        Reason.RANGE_NEGATIVE: "they are below zero, so calibrate the antenna delay",
        Reason.RANGE_ABSURD: "no radio reaches so far, so send metres",
        Reason.RANGE_STUCK: "they are equal although the tag moves, so restart the radio that repeats itself",
    },
    "heading": _ANY | {Reason.HEADING_ABSURD: "they are hundreds of turns, so send radians"},
    "bearing": _ANY | {Reason.BEARING_ABSURD: "they are hundreds of turns, so send radians"},
    MESSAGE: {
        Reason.ENCODING_UNKNOWN: "their encoding is not one of the two of this protocol",
        Reason.PAYLOAD_EMPTY: "they are empty",
        Reason.NO_SAMPLES: "they are empty",
        Reason.JSON_SYNTAX: "they are not JSON as this protocol has it",
        Reason.JSON_SCHEMA: "they are not JSON as this protocol has it",
        Reason.NOT_FINITE: NOT_NUMBERS,
        Reason.TIME_OUT_OF_RANGE: WRONG_TIMES,
        Reason.TIME_NOT_UTC: WRONG_TIMES,
        Reason.PAYLOAD_TOO_LARGE: DAMAGED,
        Reason.HEADER_TRUNCATED: DAMAGED,
        Reason.VERSION_UNKNOWN: DAMAGED,
        Reason.FLAGS_UNKNOWN: DAMAGED,
        Reason.RESERVED_NOT_ZERO: DAMAGED,
        Reason.LENGTH_MISMATCH: DAMAGED,
    },
}


def hints_about_unused(rows: Array, tags: TagTable, now_ns: int) -> Iterator[tuple[str, int]]:
    """Yield a hint for each of these rows most of whose last samples of a kind were not used, with its place."""
    known = np.flatnonzero(tags.rows.recent.are_known(rows))
    if not len(known):  # so it is for a fleet without trouble
        return
    recent = tags.rows.recent_counts(rows[known])
    unused = recent["screened"].astype(np.int64)
    unused[:, : len(KINDS)] += recent["unused"]
    arrived = np.column_stack([recent["samples"] + recent["screened"][:, : len(KINDS)], recent["messages"]])
    sends = now_ns - tags.counts(rows[known])["last_heard_ns"] < STILL_NS
    most = sends[:, None] & (unused >= LEAST) & (2 * unused > arrived)
    for i in np.flatnonzero(most.any(axis=1)).tolist():
        what = int(np.where(most[i], unused[i], 0).argmax())
        why = _why(SCREENED[what], recent["rejected"][i], int(rows[known[i]]), tags)
        if why is not None:
            count, of = int(unused[i, what]), int(max(unused[i, what], arrived[i, what]))
            yield NOT_USED.format(count, of, NOUNS[SCREENED[what]], why), int(known[i])


def _why(what: str, rejected: Array, row: int, tags: TagTable) -> str | None:
    """Return why most of these samples or messages were not used; None if another hint says it."""
    reason = max(WHY[what], key=lambda reason: rejected[REASONS.index(reason)])
    if what == "range" and reason is Reason.LATE:
        arrivals = tags.arrivals.of(np.array([row]))[0]
        behind_s = (arrivals["newest_imu_ns"] - arrivals["newest_range_ns"]) * 1e-9
        if behind_s > BEHIND_S:
            return BEHIND.format(f"{behind_s:.1f}")
    return WHY[what][reason]
