"""Times as people write them: ISO 8601, always with a time zone, to the nanosecond."""

import re
from datetime import UTC, datetime, timedelta

import numpy as np

from dropanchor_service.estimation.columns import Array

EXPECTED = "a time in ns, or as ISO 8601 with a time zone, such as 2026-01-31T09:30:00Z, was expected"
_ISO = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d(?::\d\d)?)(?:[.,](\d{1,9}))?(Z|[+-]\d\d:?\d\d)", re.ASCII)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def iso_utc(t_ns: int) -> str:
    """Return a time, UTC in ns, as ISO 8601."""
    return f"{np.datetime64(t_ns, 'ns')}Z"


def isos_utc(t_ns: Array) -> list[str]:
    """Return times, UTC in ns, as ISO 8601."""
    texts: list[str] = np.datetime_as_string(t_ns.astype("datetime64[ns]"), timezone="UTC").tolist()
    return texts


def ns_of_iso(text: str) -> int:
    """Return the time of an ISO 8601 text, UTC in ns. Raises ValueError."""
    found = _ISO.fullmatch(text)
    if found is None:
        raise ValueError(EXPECTED)
    whole, fraction, zone = found.groups()
    since = datetime.fromisoformat(whole + zone) - _EPOCH
    return since // timedelta(seconds=1) * 1_000_000_000 + int((fraction or "").ljust(9, "0"))
