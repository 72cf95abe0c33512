"""`dropanchor restore`: put a backup back in place."""

import argparse
import os
import sys
from pathlib import Path

from dropanchor_service.commands.backup import EXIT_ERROR, add_place, folders_at, settings_at
from dropanchor_service.commands.backup_files import BackupError, restore
from dropanchor_service.settings.sources import SettingsError

DESCRIPTION = """\
Copies a backup of `dropanchor backup` to where a service looks for it: into a data folder, or into the folders of data
and credentials that a settings file names. It first compares all files with the checksums, and never overwrites
anything: the folders must be empty or missing. Run it as the user of the service.
"""
EPILOG = """\
examples:
  dropanchor restore /mnt/backups/yard-monday data
  dropanchor restore /mnt/backups/20261128T031500Z /etc/dropanchor/dropanchor.toml
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("backup", metavar="BACKUP", type=Path, help="folder that `dropanchor backup` made")
    add_place(parser, "to")


def run(arguments: argparse.Namespace) -> int:
    """Restore a backup. Return 0, or 2 on an error."""
    os.umask(0o077)
    try:
        folders = folders_at(arguments.place, settings_at(arguments.place))
        restore(arguments.backup, folders)
    except (BackupError, SettingsError, OSError) as error:
        sys.stderr.write(f"dropanchor restore: {error}\n")
        return EXIT_ERROR
    print("restored: " + ", ".join(f"{name} to {folder}" for name, folder in folders.items()))
    return 0
