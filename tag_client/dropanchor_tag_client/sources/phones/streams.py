"""Readings of one sensor over time."""

from bisect import bisect_left
from collections.abc import Iterable

from dropanchor_schemas.wire import Vector

Reading = tuple[int, Vector]
"""Time, UTC in ns, and the values of the three axes."""


class Stream:
    """Readings in order of time, one for each time. t_ns: UTC. values: of the three axes at these times."""

    __slots__ = ("t_ns", "values")

    def __init__(self, t_ns: list[int], values: list[Vector]) -> None:
        self.t_ns = t_ns
        self.values = values

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def newest_ns(self) -> int:
        """Time of the last reading; -1 without any."""
        return self.t_ns[-1] if self.t_ns else -1

    def readings(self) -> Iterable[Reading]:
        return zip(self.t_ns, self.values, strict=True)

    def since(self, t_ns: int, most: int) -> "Stream":
        """Return the readings from this time on, at most the newest `most` of them."""
        first = max(bisect_left(self.t_ns, t_ns), len(self) - most)
        return Stream(self.t_ns[first:], self.values[first:])

    def merged(self, other: "Stream") -> "Stream":
        """Return the readings of both. Where both have a time, the reading of this one stays."""
        if other and other.t_ns[0] > self.newest_ns:
            return Stream(self.t_ns + other.t_ns, self.values + other.values)
        return make_stream([*self.readings(), *other.readings()])

    def at(self, t_ns: int, max_gap_ns: int) -> Vector | None:
        """Interpolate linearly at a time. Return None without readings on both sides, at most `max_gap_ns` apart."""
        after = bisect_left(self.t_ns, t_ns)
        if after < len(self) and self.t_ns[after] == t_ns:
            return self.values[after]
        if not 0 < after < len(self):
            return None
        gap_ns = self.t_ns[after] - self.t_ns[after - 1]
        if gap_ns > max_gap_ns:
            return None
        share = (t_ns - self.t_ns[after - 1]) / gap_ns
        x, y, z = (a + share * (b - a) for a, b in zip(self.values[after - 1], self.values[after], strict=True))
        return x, y, z


def make_stream(readings: Iterable[Reading]) -> Stream:
    """Return the readings in order of time, the first one of those with the same time."""
    found: dict[int, Vector] = {}
    for t_ns, value in readings:
        found.setdefault(t_ns, value)
    times = sorted(found)
    return Stream(times, [found[t_ns] for t_ns in times])
