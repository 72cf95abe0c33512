"""`dropanchor history`: move the history of a site from its file into a database."""

import argparse
import sys
import time
from pathlib import Path

from tqdm import tqdm

from dropanchor_service.commands.history_move import HistoryFile, Moved, move, summarise
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.storage import Retention
from dropanchor_service.persistence.site import open_database, retention_of
from dropanchor_service.settings.sources import SettingsError, load_settings

DESCRIPTION = """\
Moves the history of a site from the file of a service into a PostgreSQL database: `move` copies all poses and makes
their summaries, so that the page and REST answer as before. It can be stopped at any time; run again, it copies what is
missing. The service may run meanwhile. The file stays as it is.
"""
EPILOG = """\
example:
  dropanchor history move --from /var/lib/dropanchor/history.sqlite --to postgresql://dropanchor@db.example/dropanchor
how:
  1. let the service use the database: set history.url, and keep_days to no less than before; then restart it
  2. run the command, with --site if the site has an id
  3. when the page shows the past as before, delete the file
"""
REFUSED = (HistoryError, SettingsError)
EXIT_STOPPED = 130
DEFAULT_SITE = "default"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    one = actions.add_parser("move", help="copy the history of a site from its file into a database")
    one.add_argument("--from", dest="file", type=Path, required=True, metavar="FILE", help="history.sqlite of the site")
    one.add_argument("--to", dest="url", required=True, metavar="URL", help="database, without a password")
    one.add_argument("--password-file", type=Path, metavar="FILE", help="file with the password of the database")
    one.add_argument("--site", default=DEFAULT_SITE, metavar="ID", help="id of the site (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Move a history. Return 0, or 130 if it was stopped. Raises REFUSED."""
    to = {"url": arguments.url, "password_file": arguments.password_file}
    try:
        settings = load_settings(None, {"history": {name: each for name, each in to.items() if each is not None}}, {})
        database = open_database(settings, time.time_ns)
        assert database is not None
        try:
            _move(HistoryFile(arguments.file), database, arguments.site, retention_of(settings.history))
        finally:
            database.close()
    except KeyboardInterrupt:
        sys.stderr.write("\ndropanchor history: stopped. Run it again to go on.\n")
        return EXIT_STOPPED
    return 0


def _move(file: HistoryFile, database: Database, site: str, otherwise: Retention) -> None:
    # A slot is ten seconds: counting the poses themselves would read the whole file first.
    with tqdm(total=file.count_slots() * 10, unit="s", unit_scale=True, desc="copying") as bar:

        def tell(moved: Moved) -> None:
            bar.update(moved.slots * 10 - bar.n)
            bar.set_postfix_str(f"{moved.copied} poses copied")

        moved = move(file, database, site, otherwise, tell)
    with tqdm(unit=" rounds", desc="summaries") as bar:
        while summarise(database, site, otherwise):
            bar.update()
    print(f"{site}: {moved.copied} poses copied, {moved.present} were there already.")
