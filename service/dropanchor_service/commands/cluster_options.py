"""What the actions of `dropanchor cluster` share."""

import argparse
import sys
from pathlib import Path

from dropanchor_service.settings.sources import load_settings

EXIT_ERROR = 2


def add_database_options(action: argparse.ArgumentParser) -> None:
    action.add_argument("--config", type=Path, metavar="FILE", help="settings file (TOML) with cluster.url")
    action.add_argument("--url", metavar="URL", help="PostgreSQL database of the cluster, instead of cluster.url")


def url_of(arguments: argparse.Namespace) -> str:
    """Return the address of the database. Raises ValueError."""
    given = {} if arguments.url is None else {"url": arguments.url}
    bucket = {"bucket": "any"} if given and arguments.config is None else {}
    url = load_settings(arguments.config, {"cluster": given | bucket}).cluster.url
    if url is None:
        raise ValueError("say which database: --url URL, or --config FILE with cluster.url")
    return url


def refuse(text: str) -> int:
    sys.stderr.write(f"dropanchor cluster: {text}\n")
    return EXIT_ERROR
