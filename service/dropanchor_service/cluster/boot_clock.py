"""The clock that leases are counted with."""

import time


def boot_s() -> float:
    """Return the seconds since the machine was started.

    Nobody can set this clock, and unlike the monotonic one it goes on while the machine is suspended.
    """
    return time.clock_gettime(time.CLOCK_BOOTTIME)
