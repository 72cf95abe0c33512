"""The version that wrote into a folder. What an older one cannot read there is not damaged.

The file `written_by` names the latest version that has written into the folder or below. Databases and checkpoints also
have numbers of their own.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from pydantic import ValidationError

from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_tag_client.host import VERSION

FILE = "written_by"
_ABOVE = 3  # folders in which it may lie: a file of one of several sites is in sites/SITE
_UNKNOWN = ("extra_forbidden", "union_tag_invalid", "literal_error", "enum")  # what a later version may have written


def mark(folder: Path) -> None:
    """Say in a folder that this version writes there, unless a later one has."""
    with suppress(OSError):  # a disk that is full or read-only: nothing else is written then
        if (written := _read(folder / FILE)) is None or _number(written) < _number(VERSION):
            write_atomically(folder / FILE, [f"{VERSION}\n".encode()])


def writer_of(folder: Path) -> str | None:
    """Return the latest version that has written into a folder, None if it is not known."""
    return _read(folder / FILE)


def later_version(path: Path) -> str | None:
    """Return the version that has written a file or beside it, None if it is not known or not later than this one."""
    found = next((version for folder in _above(path) if (version := _read(folder / FILE)) is not None), None)
    return found if found is not None and _number(found) > _number(VERSION) else None


def of_later(what: object, how: str, beside: Path | None = None) -> str:
    """Return what to say of something that a later version wrote. how: what shows it. beside: a file of the folder."""
    version = None if beside is None else later_version(beside)
    if version is None:
        return say("of_later", "a later version wrote {what} ({how}): install that version", what=what, how=how)
    return say(
        "of_later_version",
        "version {version} wrote {what} ({how}), and this is {own}: install version {version}",
        version=version,
        what=what,
        how=how,
        own=VERSION,
    )


def later_schema(what: object, found: int, known: int, beside: Path | None = None) -> str:
    """Return what to say of a database whose schema this version does not know yet."""
    how = say("schema_later", "it has schema {found}, and this version knows {known}", found=found, known=known)
    return of_later(what, how, beside)


def later_in(path: Path, error: Exception) -> str | None:
    """Return what to say of a file if this error comes from what only a later version can have written, else None."""
    found = error.errors(include_url=False, include_input=False) if isinstance(error, ValidationError) else []
    if not found or any(each["type"] == "json_invalid" for each in found):
        return None
    if later_version(path) is None and not all(each["type"] in _UNKNOWN for each in found):
        return None
    unknown = ".".join(str(part) for part in found[0]["loc"])
    return of_later(path, f"this version does not understand {unknown}", path)


def _above(path: Path) -> Iterator[Path]:
    yield from list(path.absolute().parents)[:_ABOVE]


def _read(file: Path) -> str | None:
    try:
        return file.read_text("utf-8").strip()
    except (OSError, ValueError):
        return None


def _number(version: str) -> tuple[int, ...]:
    """Return what versions are compared by; of `1.2.3rc1` it is 1, 2, 3."""
    return tuple(int(digits) for digits in re.findall(r"(?:^|\.)(\d+)", version)[:3])
