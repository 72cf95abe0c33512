"""Find zenoh-pico, which no package manager installs."""

import os
from pathlib import Path


def zenoh_pico() -> Path | None:
    """Return the folder that holds `include/zenoh-pico.h`; None if it is not installed."""
    for folder in (os.environ.get("ZENOH_PICO_PREFIX", ""), "/usr/local", "/usr"):
        if folder and (Path(folder) / "include/zenoh-pico.h").is_file():
            return Path(folder)
    return None
