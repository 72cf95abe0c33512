"""The files of a source: a single file, those of a folder, or those of a zip archive."""

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast

from dropanchor_service.importing.readings import ImportingError
from dropanchor_tag_client.recording.bounded import require_plausible, unpacked

MAX_FILES = 10_000
ZIP_MAGIC = b"PK\x03\x04"


@dataclass(frozen=True)
class File:
    """A file on the disk or in an archive. name: its path within the source."""

    name: str
    path: Path
    member: str | None = None

    @property
    def stem(self) -> str:
        """Its name without folders and endings, in lower case."""
        return PurePosixPath(self.name).name.partition(".")[0].lower()

    @contextmanager
    def opened(self) -> Iterator[BinaryIO]:
        """Open it for reading, without its compression. Raises ImportingError."""
        try:
            if self.member is not None:
                with zipfile.ZipFile(self.path) as archive, archive.open(self.member) as inner:
                    info = archive.getinfo(self.member)
                    require_plausible(f"{self.path}: {self.name}", info.compress_size, info.file_size)
                    yield cast("BinaryIO", inner)
            else:
                with unpacked(self.path) as file:
                    yield file
        except (OSError, EOFError, zipfile.BadZipFile, RuntimeError, NotImplementedError, zlib.error) as error:
            raise ImportingError(f"{self.path}: {self.name} cannot be read: {error}") from error

    def size(self) -> int:
        """Return its size in bytes, 0 if only unpacking tells."""
        if self.member is None:
            return 0 if self.name.endswith(".gz") else self.path.stat().st_size
        with zipfile.ZipFile(self.path) as archive:
            return archive.getinfo(self.member).file_size


def files_of(path: Path) -> list[File]:
    """Return the files of a source. Raises ImportingError where there is none or the archive is damaged."""
    if path.is_dir():
        found = sorted(
            inner for inner in path.rglob("*") if inner.is_file() and not _is_hidden(inner.relative_to(path))
        )
        files = [File(inner.relative_to(path).as_posix(), inner) for inner in found[:MAX_FILES]]
    elif not path.exists():
        raise ImportingError(f"{path} does not exist")
    elif first_bytes(path, 4) == ZIP_MAGIC or path.suffix.lower() == ".zip":
        files = [File(name, path, name) for name in _members(path)]
    else:
        files = [File(path.name, path)]
    if not files:
        raise ImportingError(f"{path} holds no file")
    return files


def first_bytes(path: Path, count: int) -> bytes:
    """Return the first bytes of a file. Raises ImportingError."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise ImportingError(f"{path} cannot be read: {error.strerror or error}") from error


def _members(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = [info.filename for info in archive.infolist() if not info.is_dir()]
    except (OSError, zipfile.BadZipFile) as error:
        raise ImportingError(
            f"{path} is a damaged zip archive ({error}): was it copied or downloaded to its end? Make the export again"
        ) from error
    return [name for name in sorted(names)[:MAX_FILES] if not _is_hidden(PurePosixPath(name))]


def _is_hidden(path: PurePosixPath | Path) -> bool:
    """Return whether it is a file that systems add, such as __MACOSX/._a.csv."""
    return any(part.startswith((".", "__MACOSX")) for part in path.parts)
