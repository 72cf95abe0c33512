"""Convert the clock of a module to UTC."""

_DRIFT = 200e-6  # more than any crystal drifts
_JUMP_NS = 1_000_000_000


class DeviceClock:
    """Convert the times of a module to UTC. The message with the least delay gives the offset between the clocks."""

    def __init__(self) -> None:
        self._offset_ns: int | None = None
        self._last_ns = 0

    def utc_ns(self, arrival_ns: int, device_ns: int) -> int:
        """Return the time of a measurement, ns UTC.

        arrival_ns: UTC, when it arrived. device_ns: its time on the module's clock. A jump of either clock, as after a
        restart of the module, starts a new offset.
        """
        offset_ns = arrival_ns - device_ns
        if self._offset_ns is None or abs(offset_ns - self._offset_ns) > _JUMP_NS:
            self._offset_ns = offset_ns
        else:
            allowed_ns = round(_DRIFT * max(0, arrival_ns - self._last_ns))
            self._offset_ns = min(offset_ns, self._offset_ns + allowed_ns)
        self._last_ns = arrival_ns
        return device_ns + self._offset_ns
