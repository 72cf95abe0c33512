"""What a port may say that is no UWB module, so that it can be called by its name."""

import re

_WITMOTION = "a WitMotion sensor in its binary protocol: an IMU, which measures no ranges"
_FOREIGN = (
    (re.compile(rb"(?:\x55[\x50-\x5a].{9}){2}", re.DOTALL), _WITMOTION),
    (re.compile(rb"(?:YY.{7}){3}", re.DOTALL), "a TFmini or another lidar: it measures with light"),
    (re.compile(rb"(?:\xb5b[\x01-\x29].*?){2}", re.DOTALL), "a GNSS receiver of u-blox in its binary protocol"),
    (re.compile(rb"(?:\xfd.[\x00\x01]\x00.{6,300}?){2}", re.DOTALL), "an autopilot that speaks MAVLink"),
    (re.compile(rb"\$(?:G[APNLB]|BD)[A-Z]{3},[^\r\n]*\*[0-9A-F]{2}"), "a GNSS receiver (NMEA)"),
)
_CHECKSUM_AT = 10


def foreign_to_uwb(data: bytes) -> str | None:
    """Return what is known to print this, if it is no UWB module."""
    for expression, name in _FOREIGN:
        found = expression.search(data)
        if found and (name is not _WITMOTION or sum(found[0][:_CHECKSUM_AT]) & 0xFF == found[0][_CHECKSUM_AT]):
            return name
    return None
