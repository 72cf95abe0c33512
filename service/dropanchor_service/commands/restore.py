"""`dropanchor restore`: put a backup back in place."""

import argparse
import os
from pathlib import Path

from dropanchor_service.commands.backup import add_place, folders_at, settings_at
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

REFUSED = (BackupError, SettingsError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("backup", metavar="BACKUP", type=Path, help="folder that `dropanchor backup` made")
    add_place(parser, "to")


def run(arguments: argparse.Namespace) -> None:
    """Restore a backup. Raises REFUSED."""
    os.umask(0o077)
    folders = folders_at(arguments.place, settings_at(arguments.place))
    restore(arguments.backup, folders)
    print("restored: " + ", ".join(f"{name} to {folder}" for name, folder in folders.items()))
