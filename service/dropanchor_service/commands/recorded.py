"""A recording as the tag of the demo: its anchors, the operator's settings of the tag, and the files to replay."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from dropanchor_schemas.site import Anchor, StartPose, TagSettings
from dropanchor_service.offline.plaza import FILES, PLAZA_SCALE, PLAZA_STD, read_plaza
from dropanchor_service.settings.model import Settings
from dropanchor_tag_client.recording import Recording, RecordingError, read_recording


@dataclass(frozen=True)
class RecordedTag:
    """The tag of a recording. name: of the recording and the tag. folder: files that `dropanchor-tag replay` reads."""

    name: str
    folder: Path
    anchors: list[Anchor]
    tag: TagSettings

    def add_to(self, settings: Settings) -> Settings:
        """Return the settings with the recording's anchors and tag. They keep a tag that they already have."""
        site = settings.site.model_copy(update={"anchors": self.anchors})
        return settings.model_copy(update={"site": site, "tags": {self.name: self.tag} | dict(settings.tags)})


@contextmanager
def recorded_tag(name: str) -> Iterator[RecordedTag]:
    """Provide the tag of `plaza1`, `plaza2` or the folder of a recording. Raises RecordingError."""
    if name not in FILES:
        recording = read_recording(name)
        yield RecordedTag(recording.name, Path(name), _anchors(recording), _tag(recording))
        return
    plaza = read_plaza(name)
    with TemporaryDirectory() as folder:
        _write(plaza, Path(folder))
        calibration = {"range_scale": PLAZA_SCALE, "range_std_m": PLAZA_STD}
        yield RecordedTag(name, Path(folder), _anchors(plaza), _tag(plaza).model_copy(update=calibration))


def _anchors(recording: Recording) -> list[Anchor]:
    return [Anchor(id=anchor.id, x=anchor.x, y=anchor.y, z=anchor.z) for anchor in recording.anchors]


def _tag(recording: Recording) -> TagSettings:
    """Return the true start pose at the first range and the mean height, or defaults without a truth."""
    truth = {name: np.asarray(column) for name, column in recording.truth.items()}
    if not len(truth["t_s"]):
        return TagSettings()
    if not len(recording.ranges["t_s"]):
        raise RecordingError(f"recording {recording.name} has no range")
    first = int(np.argmin(np.abs(truth["t_s"] - recording.ranges["t_s"][0])))
    x, y, yaw = (float(truth[name][first]) for name in ("x", "y", "yaw_rad"))
    height = float(np.nanmean(truth["z"])) if np.isfinite(truth["z"]).any() else 0.0
    start = StartPose(x=x, y=y, heading_rad=yaw if np.isfinite(yaw) else None)
    return TagSettings(height_m=height, start=start)


def _write(recording: Recording, folder: Path) -> None:
    """Write the files that a replay needs: anchors, ranges and headings."""
    ranges, headings = recording.ranges, recording.headings
    ids, x, y, z = zip(*((a.id, a.x, a.y, a.z) for a in recording.anchors), strict=True)
    _table(folder / "anchors.csv", {"id": ids, "x": x, "y": y, "z": z})
    _table(
        folder / "range.csv",
        {"t_s": ranges["t_s"], "anchor_id": recording.range_anchors, "range_m": ranges["range_m"]},
    )
    _table(folder / "heading.csv", {"t_s": headings["t_s"], "yaw_rad": headings["yaw_rad"]})


def _table(path: Path, columns: Mapping[str, Sequence[Any]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
