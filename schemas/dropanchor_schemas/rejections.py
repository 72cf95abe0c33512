"""The reasons for rejections, each with an explanation. This module needs only the standard library."""

from enum import StrEnum
from typing import NamedTuple


class Reason(StrEnum):
    """Why a payload, a sample or a key was rejected. The service counts rejections by these names."""

    ENCODING_UNKNOWN = "encoding_unknown"
    PAYLOAD_EMPTY = "payload_empty"
    PAYLOAD_TOO_LARGE = "payload_too_large"
    HEADER_TRUNCATED = "header_truncated"
    VERSION_UNKNOWN = "version_unknown"
    FLAGS_UNKNOWN = "flags_unknown"
    RESERVED_NOT_ZERO = "reserved_not_zero"
    LENGTH_MISMATCH = "length_mismatch"
    NO_SAMPLES = "no_samples"
    JSON_SYNTAX = "json_syntax"
    JSON_SCHEMA = "json_schema"
    TIME_OUT_OF_RANGE = "time_out_of_range"
    NOT_FINITE = "not_finite"
    RANGE_NEGATIVE = "range_negative"
    RANGE_ABSURD = "range_absurd"
    IMU_ABSURD = "imu_absurd"
    HEADING_ABSURD = "heading_absurd"
    BEARING_ABSURD = "bearing_absurd"
    STD_INVALID = "std_invalid"
    NO_HEALTH = "no_health"
    HEALTH_ABSURD = "health_absurd"
    HEALTH_TOO_OFTEN = "health_too_often"
    ANCHOR_UNKNOWN = "anchor_unknown"
    LATE = "late"
    RANGE_STUCK = "range_stuck"
    DUPLICATE = "duplicate"
    KEY_INVALID = "key_invalid"
    TAG_UNKNOWN = "tag_unknown"
    TAG_UNCONFIRMED = "tag_unconfirmed"
    TAG_QUARANTINED = "tag_quarantined"
    TAGS_FULL = "tags_full"
    SHED = "shed"
    ESTIMATOR_FAULT = "estimator_fault"
    TIME_NOT_UTC = "time_not_utc"
    TIME_REPEATED = "time_repeated"
    IMU_STUCK = "imu_stuck"
    SENSOR_FAULT = "sensor_fault"
    PRESSURE_NOT_PA = "pressure_not_pa"
    PRESSURE_ABSURD = "pressure_absurd"
    TEMPERATURE_ABSURD = "temperature_absurd"
    PRESSURE_DOUBTED = "pressure_doubted"


class Explanation(NamedTuple):
    """Explanation of one reason.

    scope: what is rejected, the whole message or a single sample. cause: why, in words.
    """

    scope: str
    cause: str


REASONS_EXPLAINED: dict[Reason, Explanation] = {
    Reason.ENCODING_UNKNOWN: Explanation(
        "message",
        "the Zenoh encoding is neither of the two (a schema after `;` is ignored; `zenoh/bytes;application/…`, as "
        "zenoh-pico sends it, is accepted too)",
    ),
    Reason.PAYLOAD_EMPTY: Explanation("message", "the payload is empty"),
    Reason.PAYLOAD_TOO_LARGE: Explanation("message", "more than 65,536 bytes; for health, 1,024"),
    Reason.HEADER_TRUNCATED: Explanation("message", "packed, shorter than the 32-byte header"),
    Reason.VERSION_UNKNOWN: Explanation("message", "the version is not 1"),
    Reason.FLAGS_UNKNOWN: Explanation("message", "a flag bit other than bits 0 and 1 is set"),
    Reason.RESERVED_NOT_ZERO: Explanation("message", "a byte of the header that no count uses is not zero"),
    Reason.LENGTH_MISMATCH: Explanation("message", "the length does not match the counts"),
    Reason.NO_SAMPLES: Explanation("message", "the message has no samples"),
    Reason.JSON_SYNTAX: Explanation("message", "not JSON in UTF-8"),
    Reason.JSON_SCHEMA: Explanation("message", "JSON that does not match the schema"),
    Reason.TIME_OUT_OF_RANGE: Explanation("message, sample", "a time before 0, or not before 2⁶² ns, which is in 2116"),
    Reason.NOT_FINITE: Explanation("sample", "NaN or infinity where a value belongs"),
    Reason.RANGE_NEGATIVE: Explanation("sample", "a range below zero"),
    Reason.RANGE_ABSURD: Explanation("sample", "a range beyond the reach of UWB radios"),
    Reason.IMU_ABSURD: Explanation("sample", "a value beyond the range of such sensors"),
    Reason.HEADING_ABSURD: Explanation("sample", "an angle of hundreds of turns"),
    Reason.BEARING_ABSURD: Explanation("sample", "an angle of hundreds of turns"),
    Reason.STD_INVALID: Explanation("sample", "a standard deviation that is negative, zero or absurd"),
    Reason.NO_HEALTH: Explanation("message", "the message about a tag's health has no values"),
    Reason.HEALTH_ABSURD: Explanation(
        "value", "a value of a tag's health that no tag can measure; the others are used"
    ),
    Reason.HEALTH_TOO_OFTEN: Explanation("message", "the tag reports its health more than five times in a second"),
    Reason.ANCHOR_UNKNOWN: Explanation("sample", "an anchor that the site does not have"),
    Reason.LATE: Explanation("sample", "older than the samples that the estimator can still go back to"),
    Reason.RANGE_STUCK: Explanation("sample", "the radio repeats this range although the tag moves"),
    Reason.DUPLICATE: Explanation("message", "this sequence of this boot id was already used"),
    Reason.KEY_INVALID: Explanation("message", "the key does not follow this contract"),
    Reason.TAG_UNKNOWN: Explanation("message", "the service admits registered tags only"),
    Reason.TAG_UNCONFIRMED: Explanation(
        "message", "there are many new tags, and this one sent no second message before it was forgotten"
    ),
    Reason.TAG_QUARANTINED: Explanation("message", "the tag is new, and an operator has not admitted it yet"),
    Reason.TAGS_FULL: Explanation("message", "the service has reached its maximum number of tags"),
    Reason.SHED: Explanation("message", "the service was overloaded and dropped it"),
    Reason.ESTIMATOR_FAULT: Explanation("sample", "the estimator of this tag failed on it"),
    Reason.TIME_NOT_UTC: Explanation(
        "message, sample", "UTC before 2015, as seconds, milliseconds or microseconds look where nanoseconds belong"
    ),
    Reason.TIME_REPEATED: Explanation("sample", "an IMU sample that is not newer than the one before it"),
    Reason.IMU_STUCK: Explanation("sample", "the IMU repeats its last sample to the last bit"),
    Reason.SENSOR_FAULT: Explanation(
        "sample", "the sensor failed its check (units, axes, silence), as the tag's hint says"
    ),
    Reason.PRESSURE_NOT_PA: Explanation(
        "sample",
        "a pressure below 30,000 Pa: 1013 looks like hPa, multiply it by 100; 101 like kPa, multiply it by 1000",
    ),
    Reason.PRESSURE_ABSURD: Explanation("sample", "a pressure above 110,000 Pa"),
    Reason.TEMPERATURE_ABSURD: Explanation("sample", "a pressure with a temperature outside -60 to 85 °C"),
    Reason.PRESSURE_DOUBTED: Explanation(
        "sample", "a pressure that jumps: a door slams, or the tag is suddenly elsewhere, which two seconds will show"
    ),
}
