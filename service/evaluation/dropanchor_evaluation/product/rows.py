"""The rows of the evaluation: motion, sensors, configured settings, and known or unknown start."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path

from dropanchor_evaluation.product.disturbances import BIASES, FIELD, HEADINGS, MOUNTS, PATHS, QUIET, RANGE_ERRORS
from dropanchor_evaluation.recordings import recordings_in

DEVELOPMENT_SEEDS = range(5000, 6000)
"""Seeds for development and tuning of an engine. Never use others for that."""
FIRST_REPORTED_SEED = 23_100
"""First seed that may be reported: nothing was tuned on it. Raise it when a report has used the seeds from it on."""
FORMERLY_REPORTED_SEEDS = range(20_000, FIRST_REPORTED_SEED)

VEHICLES = ("P", "S5", "M5", "OU", "C5")
MOTIONS = (*VEHICLES, "rolling", "forklift")
TURNED = ("S5", "C5", "rolling", "forklift")  # also with a tag that is mounted quite another way
CARRIED = ("walk-hand", "walk-pocket", "walk-turned")
SENSORS = ("scalar", "9-axis", "6-axis")
BARE = "9-axis-bare"
CONFIGURED = ("everything", "mount", "nothing")
STARTS = ("known", "unknown")
FAST = "-100Hz"
QUICK = ("*/everything/known", "*/nothing/unknown", "walk-*/nothing/known", "phones-*")


@dataclass(frozen=True)
class Row:
    """One row of the evaluation.

    motion: a scenario, a walk or a recording; the suffix -100Hz means 0.2 m ranges at 100 Hz, and what follows a plus
    sign is a disturbance. sensors: scalar (platform
    heading, level axes), 9-axis (calibrated magnetometer), 9-axis-bare (10 µT of hard iron), 6-axis, or recorded.
    configured: everything, mount (the mounting angle alone), nothing, or operator (what the operator of a recording
    could know). folders: of the recordings; empty for simulations.
    """

    motion: str
    sensors: str
    configured: str
    start: str
    folders: tuple[Path, ...] = ()

    @property
    def name(self) -> str:
        return "/".join((self.motion, self.sensors, self.configured, self.start))

    @property
    def scenario(self) -> str:
        return self.motion.partition("+")[0].removesuffix(FAST)

    @property
    def disturbance(self) -> str:
        """What the sensors of the row do that those of the simulator do not (`disturbances`), or nothing."""
        return self.motion.partition("+")[2]

    @property
    def runs_of(self) -> tuple[str, bool, tuple[Path, ...]]:
        """Key of the runs: rows with equal keys can share their runs."""
        return self.motion, self.sensors == BARE, self.folders


def simulated_rows() -> list[Row]:
    """Return all rows of simulations. A device that turns or is in a pocket has no single mounting angle."""
    full = [(*row, configured) for row in product((*MOTIONS, "walk-hand"), SENSORS) for configured in CONFIGURED]
    loose = [(motion, sensors, "nothing") for motion in CARRIED[1:] for sensors in SENSORS]
    fast = [(motion + FAST, "scalar", "everything") for motion in ("P", "S5", "M5")]
    bare = [(motion, BARE, "nothing") for motion in (*VEHICLES[1:], "walk-hand")]
    noisy = [(f"{motion}+{what}", "9-axis", "nothing") for motion in ("S5", "C5") for what in RANGE_ERRORS]
    hard = [
        *((f"S5+{what}", "scalar", "everything") for what in PATHS),
        *((f"S5+{what}", "scalar", "nothing") for what in HEADINGS),
        *((f"S5+{what}", "9-axis", "nothing") for what in FIELD if what != "hcorr"),  # that is of platforms' headings
    ]
    biased = [(f"{motion}+{what}", "9-axis", "nothing") for motion in ("S5", "forklift") for what in BIASES]
    biased += [("S5+rested0.1", "6-axis", "nothing")]
    quiet = [(f"rolling+{QUIET}", "9-axis", configured) for configured in ("everything", "nothing")]
    turned = [(f"{motion}+{what}", "9-axis", "nothing") for motion in TURNED for what in MOUNTS]
    every = (*fast, *full, *loose, *bare, *noisy, *hard, *biased, *quiet, *turned)
    return [Row(*what, start) for what in every for start in STARTS]


def recorded_rows(data: Path) -> list[Row]:
    """Return the rows of the recordings in a folder and of the walks in its subfolder `phones`, if they exist."""
    rows = [
        Row(folder.name, "recorded", configured, start, (folder,))
        for folder in recordings_in(data)
        for configured, start in (("operator", "known"), ("nothing", "known"), ("nothing", "unknown"))
    ]
    walks = recordings_in(data / "phones")
    for kind in sorted({folder.name.rpartition("_")[2] for folder in walks}):
        folders = tuple(folder for folder in walks if folder.name.endswith(f"_{kind}"))
        rows += [Row(f"phones-{kind}", "recorded", "nothing", start, folders) for start in STARTS]
    return rows


class NoRowError(ValueError):
    """No row matches the pattern."""


def selected(rows: Sequence[Row], patterns: Sequence[str]) -> list[Row]:
    """Return the rows that match a shell pattern, in their order, or all rows without patterns. Raises NoRowError."""
    for pattern in patterns:
        if not any(fnmatchcase(row.name, pattern) for row in rows):
            raise NoRowError(f"no row matches {pattern!r}; --list prints all rows")
    return [row for row in rows if not patterns or any(fnmatchcase(row.name, pattern) for pattern in patterns)]


def purpose(seeds: range) -> str:
    """Return "development" or "reported". Raises ValueError if the seeds belong to neither."""
    if not len(seeds):
        raise ValueError("there are no seeds")
    if any(seeds[0] in known and seeds[-1] in known for known in (DEVELOPMENT_SEEDS, FORMERLY_REPORTED_SEEDS)):
        return "development"
    if seeds[0] >= FIRST_REPORTED_SEED:
        return "reported"
    first, last = DEVELOPMENT_SEEDS[0], DEVELOPMENT_SEEDS[-1]
    raise ValueError(
        f"seeds {seeds[0]} to {seeds[-1]}: take {first} to {last} for development, {FIRST_REPORTED_SEED} and above "
        "for figures that are reported"
    )
