"""Times as people read them: ISO 8601 in UTC, to the nanosecond."""

import numpy as np

from dropanchor_service.estimation.columns import Array


def iso_utc(t_ns: int) -> str:
    """Return a time, UTC in ns, as ISO 8601."""
    return f"{np.datetime64(t_ns, 'ns')}Z"


def isos_utc(t_ns: Array) -> list[str]:
    """Return times, UTC in ns, as ISO 8601."""
    texts: list[str] = np.datetime_as_string(t_ns.astype("datetime64[ns]"), timezone="UTC").tolist()
    return texts
