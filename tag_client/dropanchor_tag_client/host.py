"""What Linux knows about the machine that a tag's program runs on: battery, temperature, radio."""

import re
from contextlib import suppress
from pathlib import Path

from dropanchor_tag_client.health import HealthValues

ROOT = Path("/")
VERSION = "0.1.0"  # as in pyproject.toml; importlib.metadata would load three megabytes
_RSSI = re.compile(r"^\s*\w+:\s+\S+\s+\S+\s+(-\d+)\.?\s", re.MULTILINE)


def program() -> str:
    """Return the name and the version of this program, as the firmware of its tags."""
    return f"dropanchor-tag {VERSION}"


def host_health(root: Path = ROOT) -> HealthValues:
    """Return what is known, by the names of `TagClient.publish_health`. What the machine lacks is left out."""
    found = _battery(root / "sys/class/power_supply")
    with suppress(OSError, ValueError):
        found["temperature_c"] = _number(root / "sys/class/thermal/thermal_zone0/temp") / 1000.0
    with suppress(OSError):
        levels = _RSSI.findall((root / "proc/net/wireless").read_text())
        if levels:
            found["rssi_dbm"] = float(levels[0])
    return found


def _battery(folder: Path) -> HealthValues:
    """Return charge and voltage of the first battery that powers the machine, and not a device beside it."""
    for supply in sorted(folder.glob("*")):
        found = HealthValues()
        with suppress(OSError, ValueError):
            if _text(supply / "type") != "Battery" or _text(supply / "scope") == "Device":
                continue
            found["battery_fraction"] = _number(supply / "capacity") / 100.0
            found["battery_v"] = _number(supply / "voltage_now") / 1e6
        if found:
            return found
    return HealthValues()


def _text(path: Path) -> str:
    """Return the line in a file, "" without the file."""
    return path.read_text().strip() if path.exists() else ""


def _number(path: Path) -> float:
    return float(path.read_text())
