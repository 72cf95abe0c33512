"""Tell what the user gave to `dropanchor replay`: a recording, or something that must be imported first."""

import csv
import gzip
import zlib
from collections.abc import Iterable
from pathlib import Path

from dropanchor_service.recording.mcap_file import PROFILE
from dropanchor_tag_client.recording import RecordingError
from dropanchor_tag_client.recording.columns import FORMATS
from dropanchor_tag_client.recording.csv_text import import_hint

_MCAP = b"\x89MCAP0\r\n"
_PROFILE_AT = 21  # behind the magic, an opcode and two lengths
_MAGIC = {
    b"SQLite format 3\0": "a ROS 2 bag (.db3) or another database",
    b"#ROSBAG": "a ROS 1 bag",
    b"PK\x03\x04": "a zip archive",
    b"PAR1": "a single Parquet file",
    b"\x89HDF": "an HDF5 file",
    b"ULog": "a log of PX4",
}
_PHONES = (
    ({"Accelerometer.csv", "Metadata.csv"}, "an export of Sensor Logger"),
    ({"Accelerometer.csv", "Gyroscope.csv"}, "an export of phyphox"),
)
_TEXTS = (".csv", ".tsv", ".txt", ".json", ".jsonl", ".log")
_SHOWN = 5


def mcap_files_of(path: Path) -> list[Path]:
    """Return the MCAP file, or those of a folder in order of time; empty for a folder with tables.

    Raises RecordingError for anything else, with the command that makes a recording of it where there is one.
    """
    if not path.exists():
        raise RecordingError(f"{path} does not exist")
    if not path.is_dir():
        if _is_ours(path):
            return [path]
        raise RecordingError(_not_a_recording(path, _kind_of_file(path)))
    if _has(path, "anchors") or _has(path, "range"):
        return []
    files = sorted(path.glob("*.mcap"))
    if files and all(map(_is_ours, files)):
        return files
    raise RecordingError(_why_not(path))


def _has(folder: Path, table: str) -> bool:
    return any((folder / f"{table}{ending}").is_file() for ending in FORMATS)


def _start_of(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(4096)


def _is_ours(path: Path) -> bool:
    """Return whether the profile in the header of the MCAP file is ours."""
    start = _start_of(path)
    return start.startswith(_MCAP) and start[_PROFILE_AT:].startswith(PROFILE.encode())


def _not_a_recording(path: Path, kind: str) -> str:
    return f"{path} is not a recording of this service, but looks like {kind}. {import_hint(path)}"


def _kind_of_file(path: Path) -> str:
    start = _start_of(path)
    if not start:
        raise RecordingError(f"{path} is empty")
    if start.startswith(_MCAP):
        return "an MCAP file of another program, such as a ROS 2 bag"
    for magic, kind in _MAGIC.items():
        if start.startswith(magic):
            return kind
    name = path.name.removesuffix(".gz")
    if start.startswith(b"\x1f\x8b"):
        try:
            start = gzip.GzipFile(path).read(512)
        except (OSError, EOFError, zlib.error) as error:
            raise RecordingError(f"{path} cannot be read: {error}") from error
    if name.endswith(_TEXTS) and b"\0" not in start.removeprefix(b"\xff\xfe"):
        columns = _columns(start)
        return f"a single table{f' with the columns {columns}' if columns else ''}"
    raise RecordingError(
        f"{path} is not a recording: a recording is a folder with range.csv and anchors.csv, or an MCAP file of this "
        "service"
    )


def _columns(start: bytes) -> str:
    lines = start.decode("utf-8", "replace").splitlines()
    return ", ".join(next(csv.reader(lines[:1]), [])[:8])[:100]


def _why_not(folder: Path) -> str:
    names = {entry.name for entry in folder.iterdir()}
    kind = next((kind for files, kind in _PHONES if files <= names), None)
    if kind is None and any(name.endswith((".mcap", ".db3", ".bag")) for name in names):
        kind = "a ROS bag"
    if kind is not None:
        return _not_a_recording(folder, kind)
    inside = [entry.name for entry in sorted(folder.iterdir()) if entry.is_dir() and _has(entry, "range")]
    if inside:
        return f"{folder} is not a recording; its folders are: {_some(inside)}. Give one of them"
    if not names:
        return f"{folder} is empty; a recording is a folder with range.csv and anchors.csv"
    if any(name.endswith(_TEXTS) for name in names):
        return _not_a_recording(folder, f"a folder of other tables ({_some(sorted(names))})")
    return f"{folder} has neither anchors.csv nor range.csv; a recording is a folder with both"


def _some(names: Iterable[str]) -> str:
    names = list(names)
    return ", ".join(names[:_SHOWN]) + (", …" if len(names) > _SHOWN else "")
