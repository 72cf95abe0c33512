"""What each rejection means, in words: for documents and for people."""

from typing import NamedTuple

from dropanchor_schemas.wire import Reason


class Explained(NamedTuple):
    """of: what is refused, a whole message or one sample of it. why: the cause in words."""

    of: str
    why: str


REASONS_EXPLAINED: dict[Reason, Explained] = {
    Reason.ENCODING_UNKNOWN: Explained(
        "message", "the Zenoh encoding is neither of the two (a schema after `;` is ignored)"
    ),
    Reason.PAYLOAD_EMPTY: Explained("message", "no bytes"),
    Reason.PAYLOAD_TOO_LARGE: Explained("message", "more than 65,536 bytes"),
    Reason.HEADER_TRUNCATED: Explained("message", "packed, fewer than 32 bytes"),
    Reason.VERSION_UNKNOWN: Explained("message", "the version is not 1"),
    Reason.FLAGS_UNKNOWN: Explained("message", "a flag bit other than bit 0 is set"),
    Reason.RESERVED_NOT_ZERO: Explained("message", "one of the header's last six bytes is not zero"),
    Reason.LENGTH_MISMATCH: Explained("message", "the length is not what the four counts ask for"),
    Reason.NO_SAMPLES: Explained("message", "it holds no sample"),
    Reason.JSON_SYNTAX: Explained("message", "not JSON in UTF-8"),
    Reason.JSON_SCHEMA: Explained("message", "JSON, but not what the schema asks for"),
    Reason.TIME_OUT_OF_RANGE: Explained("message, sample", "a time before 0 or not before 2⁶² ns"),
    Reason.NOT_FINITE: Explained("sample", "NaN or infinity where a value belongs"),
    Reason.RANGE_NEGATIVE: Explained("sample", "a range below zero"),
    Reason.RANGE_ABSURD: Explained("sample", "a range no UWB radio reaches"),
    Reason.IMU_ABSURD: Explained("sample", "beyond what such sensors can measure"),
    Reason.HEADING_ABSURD: Explained("sample", "an angle of hundreds of turns"),
    Reason.BEARING_ABSURD: Explained("sample", "an angle of hundreds of turns"),
    Reason.STD_INVALID: Explained("sample", "a standard deviation that is negative, zero or absurd"),
    Reason.ANCHOR_UNKNOWN: Explained("sample", "an anchor that the site does not have"),
    Reason.LATE: Explained("sample", "older than what the estimator can still go back to"),
    Reason.DUPLICATE: Explained("message", "this sequence of this boot id was used already"),
    Reason.KEY_INVALID: Explained("message", "the key is not of this contract"),
    Reason.TAG_UNKNOWN: Explained("message", "the service admits registered tags only"),
    Reason.TAG_UNPROVEN: Explained(
        "message", "many tags are new, and this one did not send another message while it was remembered"
    ),
    Reason.TAG_QUARANTINED: Explained("message", "the tag is new, and nobody has let it in yet"),
    Reason.TAGS_FULL: Explained("message", "the service has as many tags as it may"),
    Reason.SHED: Explained("message", "the service was overloaded and let it go"),
    Reason.ESTIMATOR_FAULT: Explained("sample", "the estimator of this tag failed on it"),
}
