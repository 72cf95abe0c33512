"""Open a serial port, and explain what goes wrong."""

import errno

import serial

READ_TIMEOUT_S = 0.1


class PortError(ValueError):
    """The port cannot be opened. The message says what to do."""


def open_port(name: str, baud: int) -> serial.Serial:
    """Return the open port, for exclusive use. Raises PortError."""
    try:
        return serial.Serial(name, baud, timeout=READ_TIMEOUT_S, write_timeout=1.0, exclusive=True)
    except (serial.SerialException, OSError, ValueError) as error:
        raise PortError(_what_to_do(name, baud, error)) from error


def _what_to_do(name: str, baud: int, error: Exception) -> str:
    match getattr(error, "errno", None):
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            from serial.tools.list_ports import comports  # memory that a working tag does not need

            there = ", ".join(f"{port.device} ({port.description})" for port in comports()) or "none"
            return f"there is no serial port {name}. Ports that are plugged in: {there}"
        case errno.EACCES | errno.EPERM:
            return (
                f"you may not use {name}. Add yourself to the group that may (on Debian and Ubuntu: "
                "sudo usermod -aG dialout $USER), then log out and in again"
            )
        case errno.EBUSY | errno.EAGAIN:
            return f"{name} is in use by another program; close that one first"
    if "lock" in str(error):
        return f"{name} is in use by another program; close that one first"
    return f"{name} cannot be used at {baud} baud: {error}"
