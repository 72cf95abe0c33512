"""Where the files of each site lie, and how they move when an only site becomes one of several, and back."""

import json
import logging
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.atomic_file import sync_folder, write_atomically
from dropanchor_service.runtime.data_files import OF_SITE
from dropanchor_service.runtime.recovery import copy_of
from dropanchor_service.runtime.written_by import mark
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_tag_client.folder_lock import FolderInUseError, FolderLock, LockIsLinkError

OWNER_FILE = "site"  # names the site whose files lie in the data folder itself

_log = logging.getLogger(__name__)


def own_data_folder(settings: Settings, shared: bool, note: Callable[[str], object]) -> AbstractContextManager[object]:
    """Return the lock of the data folder, which only this process may write. Raises SettingsError.

    shared: with the other shards of a node, whose leases tell them what each may write. note: takes a sentence where
    nothing keeps others out.
    """
    folder = settings.data_dir
    if folder is None:
        return nullcontext()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FolderLock(folder, shared=shared)
        if not lock.excludes_others:
            note(
                say("no_lock", "{folder} cannot be locked: a second process would lose what both write", folder=folder)
            )
        mark(folder)
        return lock
    except LockIsLinkError as error:
        raise SettingsError(f"data_dir: {error}") from error
    except FolderInUseError as error:
        raise SettingsError(f"data_dir: {error}: stop it, or give this process a folder of its own") from error
    except (FileExistsError, NotADirectoryError) as error:
        raise SettingsError(f"data_dir: {folder} is no folder: choose another one") from error
    except OSError as error:
        _log.error("data_dir: %s cannot be used (%s): nothing survives a restart", folder, error.strerror)
        return nullcontext()


def folder_of_site(data_dir: Path, site: str) -> Path:
    """Return the folder of one of `[sites]`. An only site has its files in the data folder itself."""
    return data_dir / "sites" / file_name_of(site)


def put_site_files_in_place(settings: Settings) -> None:
    """Move the files of a site to where these settings look for them. Raises SettingsError.

    Each file is renamed, and what a kill leaves behind is moved at the next start.
    """
    folder = settings.data_dir
    if folder is None:
        return
    try:
        if settings.sites:
            _give_own_folder(folder, list(settings.sites))
        else:
            _take_back(folder, settings.site.id)
    except OSError as error:
        raise SettingsError(f"data_dir: the files of a site in {folder} cannot be moved: {error}") from error


def _give_own_folder(folder: Path, served: list[str]) -> None:
    """Move the files of a site that was the only one into its own folder."""
    if not _files_in(folder):
        return
    owner = _owner_of(folder) or (served[0] if len(served) == 1 else None)
    if owner is None:
        raise SettingsError(
            f"data_dir: {folder} holds the files of an only site, and nothing says which of the sites it is: move them "
            f"into {folder_of_site(folder, served[0])}, or into the folder of another site"
        )
    _move(folder, folder_of_site(folder, owner), owner, folder)
    (folder / OWNER_FILE).unlink(missing_ok=True)


def _take_back(folder: Path, site: str) -> None:
    """Move the files of one of several sites into the data folder, now that it is the only one."""
    own, owner = folder_of_site(folder, site), _owner_of(folder)
    if _files_in(own):
        if owner not in (None, site):
            _move(folder, folder_of_site(folder, owner), owner, folder)
        _move(own, folder, site, folder)
        with suppress(OSError):  # it may hold files of others
            own.rmdir()
        owner = site
    if owner != site and not (folder / "site.json").exists():
        with suppress(OSError):  # the first change that cannot be saved is reported
            _write_owner(folder, site)


def _move(source: Path, target: Path, site: str, folder: Path) -> None:
    """Rename the files of a site. folder: the data folder, which says meanwhile whose files lie in it."""
    found = _files_in(source)
    for path in found:
        if (target / path.name).exists():
            raise SettingsError(
                f"data_dir: both {source} and {target} hold {path.name} of the site {site!r}: move one of them away"
            )
    if not found:
        return
    _write_owner(folder, site)
    target.mkdir(parents=True, exist_ok=True)
    for path in found:
        path.rename(target / path.name)
    for changed in (target, source):
        sync_folder(changed)
    _log.info("the files of the site %s were moved from %s to %s", site, source, target)


def _owner_of(folder: Path) -> str | None:
    """Return the site whose files lie in the data folder, None if nothing says so."""
    for path in (folder / "site.json", copy_of(folder / "site.json")):
        with suppress(OSError, ValueError, KeyError, TypeError):
            return str(json.loads(path.read_bytes())["site"]["id"])
    with suppress(OSError, ValueError):
        return (folder / OWNER_FILE).read_text(encoding="utf-8").strip() or None
    return None


def _write_owner(folder: Path, site: str) -> None:
    write_atomically(folder / OWNER_FILE, [f"{site}\n".encode()])


def _files_in(folder: Path) -> list[Path]:
    return [path for pattern in OF_SITE for path in sorted(folder.glob(pattern)) if path.suffix != ".part"]
