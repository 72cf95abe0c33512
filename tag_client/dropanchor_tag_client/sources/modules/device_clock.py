"""The clock of a module, laid onto ours."""

_DRIFT = 200e-6  # faster than any crystal drifts
_JUMP_NS = 1_000_000_000
_NS_PER_MS = 1_000_000


class DeviceClock:
    """Turns the times of a module into ours by the fastest of its messages: the least delay is the best offset."""

    def __init__(self) -> None:
        self._offset_ns: int | None = None
        self._last_ns = 0

    def utc_ns(self, arrival_ns: int, device_ms: int) -> int:
        """Return when the module measured, ns UTC: at its time device_ms, which arrived at arrival_ns.

        A module that starts again, or a clock that is set, starts a new offset."""
        device_ns = device_ms * _NS_PER_MS
        offset_ns = arrival_ns - device_ns
        if self._offset_ns is None or abs(offset_ns - self._offset_ns) > _JUMP_NS:
            self._offset_ns = offset_ns
        else:
            allowed_ns = round(_DRIFT * max(0, arrival_ns - self._last_ns))
            self._offset_ns = min(offset_ns, self._offset_ns + allowed_ns)
        self._last_ns = arrival_ns
        return device_ns + self._offset_ns
