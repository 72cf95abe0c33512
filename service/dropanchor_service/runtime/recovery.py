"""One policy for files that are damaged: set them aside, go on from the last good copy, and say so.

A file that people have filled has a copy beside it, which is written after every change and at every good start. At a
start, a file that is damaged or cannot be read is renamed to `<name>.damaged-<date>`, and its copy takes its place; a
file without a good copy begins empty. A file of a later version is refused instead: nothing is wrong with it.
"""

import logging
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, TypeVar

from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.atomic_file import UP_TO_UMASK, sync_folder, write_atomically
from dropanchor_service.runtime.written_by import later_in, later_version

COPY = ".last-good"
MARK = ".damaged-"
COPY_USED = say("copy_used", "its last good copy is used")
BEGINS_EMPTY = say("begins_empty", "there was no good copy, so it begins empty")
DAMAGED = say("is_damaged", "is damaged")
MAX_ASIDE = 3  # of a file: a disk that keeps damaging files must not fill up with them
_WHERE = ("*", "checkpoints/*", "plans/*", "sites/*/*", "sites/*/plans/*")  # what one service may have set aside
_COMPANIONS = ("-wal", "-shm")  # of a database

Content = TypeVar("Content")
Parse = Callable[[bytes], Content]
"""Returns what is in the bytes of a file. Raises ValueError."""

_log = logging.getLogger(__name__)


class NewerFileError(ValueError):
    """A file is of a later version; the message says which, and what to do."""


class _Found(NamedTuple):
    aside: Path | None
    sentence: str


class Recovery:
    """Reads the files of a service, and knows which of them were damaged. Any thread may use it."""

    def __init__(self, root: Path | None = None) -> None:
        """root: the data folder. What earlier starts have set aside there counts, too."""
        self._root = root
        self._found: list[_Found] = []
        for aside in [] if root is None else _set_aside_below(root):
            self._found.append(
                _Found(
                    aside,
                    say("damaged_earlier", "{file} was damaged at an earlier start", file=self._name(_of_aside(aside))),
                )
            )

    def read(self, path: Path, parse: Parse[Content], mode: int = UP_TO_UMASK) -> Content | None:
        """Return what is in a file that has a copy; None if there is none, or no good one.

        mode: the permissions of the copy. Raises NewerFileError.
        """
        try:
            whole = path.read_bytes()
            found = parse(whole)
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            return self._recovered(path, parse, mode, error)
        with suppress(OSError):  # the next change or the next start tries again
            if _content(copy_of(path)) != whole:
                write_atomically(copy_of(path), [whole], mode)
        return found

    def read_alone(self, path: Path, parse: Parse[Content], instead: str) -> Content | None:
        """Return what is in a file without a copy; None if there is none, or no good one, and then say `instead`.

        Raises NewerFileError.
        """
        try:
            return parse(path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            _refuse_later(path, error)
            self.set_aside(path, _why(error), instead)
            return None

    def set_aside(self, path: Path, why: str, instead: str, like: str | None = None) -> Path | None:
        """Rename a file, complete with what belongs to it, and report it. Return its new path; None if it stays.

        why: what is wrong with it. instead: what takes its place. like: pattern of the names that are counted together
        with this one. No connection may have it open.
        """
        aside = _free_name(path, like)
        try:
            for suffix in (*_COMPANIONS, "") if aside is not None else ():  # the file itself last: a kill before that
                if (companion := Path(f"{path}{suffix}")).exists():  # loses no part of it
                    companion.rename(f"{aside}{suffix}")
        except OSError:
            aside = None
        if aside is not None and not aside.exists():  # what it lies in is no folder, or may not be read
            aside = None
        self._report(path, aside, why, instead)
        return aside

    def note(self, sentence: str) -> None:
        """Report what cannot be used until the next start."""
        _log.error("%s", sentence)
        self._found.append(_Found(None, sentence))

    def problems(self) -> Sequence[str]:
        """Return what was damaged. What was set aside is named until somebody moves it away."""
        return [
            found.sentence
            if found.aside is None
            else say(
                "aside",
                "{what}: look at {aside}, then move it away",
                what=found.sentence,
                aside=self._name(found.aside),
            )
            for found in self._found
            if found.aside is None or found.aside.exists()
        ]

    def _recovered(self, path: Path, parse: Parse[Content], mode: int, error: Exception) -> Content | None:
        """Return what is in the copy of a file, and put it in its place."""
        if later_version(path) is not None:  # the copy may be of this one
            _refuse_later(path, error)
        whole = _content(copy_of(path))
        good: Content | None = None
        if whole is not None:
            with suppress(ValueError):
                good = parse(whole)
        if whole is None or good is None:
            _refuse_later(path, error)
            self.set_aside(path, _why(error), BEGINS_EMPTY)
            return None
        self._replace(path, whole, mode, _why(error))
        return good

    def _replace(self, path: Path, whole: bytes, mode: int, why: str) -> None:
        """Put the copy in the place of a damaged file. At no moment is there none."""
        aside = _free_name(path)
        try:
            if aside is not None:
                with suppress(OSError):  # a file system without links, or something that is no file
                    os.link(path, aside)
                if not aside.exists():
                    path.rename(aside)
                sync_folder(path.parent)
        except OSError:
            aside = None
        with suppress(OSError):  # a full disk: the next start or the next change tries again
            write_atomically(path, [whole], mode)
        self._report(path, aside, why, COPY_USED)

    def _report(self, path: Path, aside: Path | None, why: str, instead: str) -> None:
        sentence = say("file_unusable", "{file} {why}; {instead}", file=self._name(path), why=why, instead=instead)
        if aside is None:
            sentence = say(
                "not_aside",
                "{what}. It is not set aside: look at the permissions of its folder, and at what earlier starts left",
                what=sentence,
            )
        _log.error("%s (%s)", sentence, f"in {path.parent}" if aside is None else f"kept as {aside}")
        self._found.append(_Found(aside, sentence))

    def _name(self, path: Path) -> str:
        """Return the name of a file, below the data folder."""
        if self._root is not None and path.is_relative_to(self._root):
            return str(path.relative_to(self._root))
        return path.name


def damaged(why: object) -> str:
    return say("is_damaged_so", "is damaged ({why})", why=why)


def unreadable(error: OSError) -> str:
    return say("is_unreadable", "cannot be read ({why})", why=error.strerror)


def write_with_copy(path: Path, content: bytes, mode: int = UP_TO_UMASK) -> None:
    """Replace a file, then its copy. Raises OSError, and then the old file is unchanged."""
    write_atomically(path, [content], mode)
    with suppress(OSError):  # the change is saved; the next one or the next start writes the copy
        write_atomically(copy_of(path), [content], mode)


def copy_of(path: Path) -> Path:
    return path.with_name(f"{path.name}{COPY}")


def was_damaged(path: Path) -> bool:
    """Return whether a file was set aside, and nobody has moved that away."""
    return any(path.parent.glob(f"{path.name}{MARK}*"))


def _set_aside_below(root: Path) -> list[Path]:
    found = [aside for where in _WHERE for aside in sorted(root.glob(f"{where}{MARK}*"))]
    return [aside for aside in found if not aside.name.endswith(_COMPANIONS)]


def _of_aside(aside: Path) -> Path:
    return aside.with_name(aside.name.partition(MARK)[0])


def _free_name(path: Path, like: str | None = None) -> Path | None:
    """Return a name for a file that is set aside now, None if there are too many already."""
    before = [one for one in path.parent.glob(f"{like or path.name}{MARK}*") if not one.name.endswith(_COMPANIONS)]
    if len(before) >= MAX_ASIDE:
        return None
    name = path.with_name(f"{path.name}{MARK}{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}")
    return name if name not in before else name.with_name(f"{name.name}-{len(before) + 1}")


def _content(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except OSError:
        return None


def _why(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return unreadable(error)
    return DAMAGED


def _refuse_later(path: Path, error: Exception) -> None:
    """Raise NewerFileError if only a later version can have written what this error comes from."""
    if (why := later_in(path, error)) is not None:
        raise NewerFileError(why) from error
