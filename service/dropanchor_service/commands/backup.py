"""`dropanchor backup`: copy what a service has on disk, while it runs."""

import argparse
import os
import sys
from pathlib import Path

from dropanchor_service.commands.backup_files import DATA, SECURITY, SETTINGS, BackupError, back_up, dated, drop_oldest
from dropanchor_service.commands.options import positive
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings

DESCRIPTION = """\
Copies the data folder of a service, or with a settings file that file, the data folder and the credentials that it
names, into a new folder. The service may run. Databases are copied in one state, and every copy is read: exit code 1
and a sentence say what is damaged. What is in PostgreSQL is left to pg_dump.
"""
EPILOG = """\
examples:
  dropanchor backup data /mnt/backups/yard-monday
  dropanchor backup /etc/dropanchor/dropanchor.toml /mnt/backups --keep 14
  dropanchor restore /mnt/backups/yard-monday data
"""
EXIT_DAMAGED = 1
REFUSED = (BackupError, SettingsError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_place(parser, "from")
    parser.add_argument("target", metavar="TARGET", type=Path, help="folder to make; it must not exist")
    parser.add_argument(
        "--keep",
        type=positive,
        metavar="N",
        help="make a folder with the date in TARGET, and keep the newest N of them",
    )


def add_place(parser: argparse.ArgumentParser, towards: str) -> None:
    parser.add_argument(
        "place",
        metavar="FOLDER_OR_CONFIG",
        type=Path,
        help=f"data folder, or settings file (TOML) that names the folders of data and credentials, to copy {towards}",
    )


def run(arguments: argparse.Namespace) -> int:
    """Make a backup. Return 0, or 1 if something in it is damaged. Raises REFUSED if there is none."""
    os.umask(0o077)  # it holds keys and secrets
    settings = settings_at(arguments.place)
    folders = folders_at(arguments.place, settings)
    missing = [str(folder) for folder in folders.values() if not folder.is_dir()]
    if missing:
        raise BackupError(f"{', '.join(missing)}: no such folder")
    files = {} if settings is None else {SETTINGS: arguments.place}
    target = arguments.target if arguments.keep is None else dated(arguments.target)
    damaged = back_up({**folders, **files}, target)
    if arguments.keep is not None and not damaged:
        drop_oldest(arguments.target, arguments.keep)
    print(f"{target} holds {', '.join([*folders, *files])}; every file was read again")
    for url in _databases(settings):
        print(f"what is in PostgreSQL is not in this backup: pg_dump --format custom --file FILE {url}")
    sys.stderr.writelines(f"dropanchor backup: {each}\n" for each in damaged)
    return EXIT_DAMAGED if damaged else 0


def _databases(settings: Settings | None) -> list[str]:
    found = [] if settings is None else [settings.history.url, settings.cluster.url]
    return list(dict.fromkeys(url for url in found if url is not None))


def settings_at(place: Path) -> Settings | None:
    """Return the settings in a file; None for a folder. Raises SettingsError."""
    return load_settings(place) if place.is_file() or place.suffix == ".toml" else None


def folders_at(place: Path, settings: Settings | None) -> dict[str, Path]:
    """Return where data and credentials are. Raises BackupError."""
    if settings is None:
        return {DATA: place}
    named = {DATA: settings.data_dir, SECURITY: settings.security.folder}
    folders = {name: folder for name, folder in named.items() if folder is not None}
    if not folders:
        raise BackupError(f"{place} names neither data_dir nor security.folder: name the data folder instead")
    return folders
