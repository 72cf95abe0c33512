"""Say which of a tag's last samples were not used, and why: from what arrived, not from what the estimate shows."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from dropanchor_schemas.kinds import PRESSURE
from dropanchor_schemas.rejections import Reason
from dropanchor_schemas.sentences import say
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.rows import KINDS, MESSAGE, REASONS, SCREENED
from dropanchor_service.store.tags import TagTable

NOUNS: Final = {
    "imu": say("noun_imu", "IMU samples"),
    "range": say("noun_range", "ranges"),
    "heading": say("noun_heading", "headings"),
    "bearing": say("noun_bearing", "bearings"),
    "pressure": say("noun_pressure", "pressures"),
    MESSAGE: say("noun_message", "messages"),
}
LEAST: Final = 3  # samples of a kind that say something
STILL_NS: Final = 5_000_000_000  # after such a silence the tag sends nothing that could be used
BEHIND_S: Final = 0.2

OUT_OF_ORDER: Final = say("why_order", "newer ones came before them, so let the tag send them in order")
NOT_NUMBERS: Final = say("why_numbers", "they hold values that are not numbers")
WRONG_TIMES: Final = say("why_times", "their times are not UTC in nanoseconds")
STD_WRONG: Final = say("why_std", "their standard deviation is not one")
FAULT: Final = say("why_fault", "the estimator failed on them, so look at the service's log")
DAMAGED: Final = say("why_damaged", "they are damaged, or not of this protocol")
TURNS: Final = say("why_turns", "they are hundreds of turns, so send radians")
EMPTY: Final = say("why_empty", "they are empty")
NOT_JSON: Final = say("why_json", "they are not JSON as this protocol has it")

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
        Reason.IMU_ABSURD: say("why_imu_absurd", "no sensor measures such values, so send m/s² and rad/s"),
        Reason.TIME_REPEATED: say("why_time_repeated", "several have the same time, so send each with its own time"),
        Reason.IMU_STUCK: say(
            "why_imu_stuck", "they are equal to the last bit, so restart the sensor that repeats itself"
        ),
    },
    "range": _ANY
    | {
        Reason.RANGE_NEGATIVE: say("why_range_negative", "they are below zero, so calibrate the antenna delay"),
        Reason.RANGE_ABSURD: say("why_range_absurd", "no radio reaches so far, so send metres"),
        Reason.RANGE_STUCK: say(
            "why_range_stuck", "they are equal although the tag moves, so restart the radio that repeats itself"
        ),
    },
    "heading": _ANY | {Reason.HEADING_ABSURD: TURNS},
    "bearing": _ANY | {Reason.BEARING_ABSURD: TURNS},
    "pressure": _ANY
    | {
        Reason.PRESSURE_NOT_PA: say("why_pressure_not_pa", "no air has so low a pressure, so send Pa"),
        Reason.PRESSURE_ABSURD: say("why_pressure_absurd", "no air has such a pressure, so send Pa"),
        Reason.TEMPERATURE_ABSURD: say("why_temperature_absurd", "no air has such a temperature, so send °C"),
        Reason.PRESSURE_DOUBTED: say(
            "why_pressure_doubted", "they jump as where doors slam, so keep the barometer out of draughts"
        ),
    },
    MESSAGE: {
        Reason.ENCODING_UNKNOWN: say("why_encoding", "their encoding is not one of the two of this protocol"),
        Reason.PAYLOAD_EMPTY: EMPTY,
        Reason.NO_SAMPLES: EMPTY,
        Reason.JSON_SYNTAX: NOT_JSON,
        Reason.JSON_SCHEMA: NOT_JSON,
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


_PRESSURE_UNITS: Final = (
    (100.0, say("why_pressure_in_hpa", "they look like hPa, so multiply them by 100")),
    (1_000.0, say("why_pressure_in_kpa", "they look like kPa, so multiply them by 1000")),
)


def not_used(count: int, of: int, what: str, why: str) -> str:
    """Return the hint about `count` of the last `of` samples or messages. what: a key of NOUNS. why: a text of WHY."""
    return say(
        "not_used",
        "{count} of its last {total} {what} were not used: {why}.",
        count=count,
        total=of,
        what=NOUNS[what],
        why=why,
    )


def behind(seconds: float) -> str:
    return say(
        "why_behind",
        "they are older than its IMU samples by {seconds} s, so check the clocks and the network of both devices",
        seconds=f"{seconds:.1f}",
    )


def hints_about_unused(rows: Array, tags: TagTable, now_ns: int) -> Iterator[tuple[str, int]]:
    """Yield a hint for each of these rows most of whose last samples of a kind were not used, with its place."""
    known = np.flatnonzero(tags.rows.recent.are_known(rows))
    if not len(known):  # so it is for a fleet without trouble
        return
    recent = tags.rows.recent_counts(rows[known])
    unused = recent["screened"].astype(np.int64)
    unused[:, : len(KINDS)] += recent["unused"]
    arrived = np.column_stack([recent["samples"] + recent["screened"][:, : len(KINDS)], recent["messages"]])
    sends = now_ns - tags.rows.counts(rows[known])["last_heard_ns"] < STILL_NS
    most = sends[:, None] & (unused >= LEAST) & (2 * unused > arrived)
    for i in np.flatnonzero(most.any(axis=1)).tolist():
        what = int(np.where(most[i], unused[i], 0).argmax())
        why = _why(SCREENED[what], recent["rejected"][i], int(rows[known[i]]), tags)
        if why is not None:
            count, of = int(unused[i, what]), int(max(unused[i, what], arrived[i, what]))
            yield not_used(count, of, SCREENED[what], why), int(known[i])


def _why(what: str, rejected: Array, row: int, tags: TagTable) -> str | None:
    """Return why most of these samples or messages were not used; None if another hint says it."""
    reason = max(WHY[what], key=lambda reason: rejected[REASONS.index(reason)])
    if what == "range" and reason is Reason.LATE:
        arrivals = tags.arrivals.of(np.array([row]))[0]
        behind_s = (arrivals["newest_imu_ns"] - arrivals["newest_range_ns"]) * 1e-9
        if behind_s > BEHIND_S:
            return behind(behind_s)
    if reason is Reason.PRESSURE_NOT_PA:
        low, high = PRESSURE.limits
        sent = tags.rows.low_pressures.get(row, 0.0)
        return next((why for factor, why in _PRESSURE_UNITS if low <= sent * factor <= high), WHY[what][reason])
    return WHY[what][reason]
