"""`dropanchor record`: control the recordings of a running service over its REST interface."""

import argparse
import shutil
from pathlib import Path
from urllib.parse import quote

from dropanchor_service.commands.rest import KEY_VARIABLE, RefusedError, add_rest_options, asked, opened

DESCRIPTION = f"""\
Starts and stops recordings of raw samples and poses, lists the files and downloads them. The service must run with a
`data_dir`. The files are MCAP: open them in Foxglove or Lichtblick, or replay them with `dropanchor replay`. If the
service requires an API key, set the environment variable {KEY_VARIABLE}.
"""
EPILOG = """\
examples:
  dropanchor record start
  dropanchor record start forklift-7 forklift-8
  dropanchor record stop
  dropanchor record list
  dropanchor record fetch yard-20270115T080000-000000Z.mcap
"""
REFUSED = (RefusedError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    start = actions.add_parser("start", help="start a recording")
    start.add_argument("tags", metavar="TAG", nargs="*", help="tags to record (default: all)")
    stop = actions.add_parser("stop", help="stop the recording")
    listed = actions.add_parser("list", help="list the files and the state of the recording")
    fetch = actions.add_parser("fetch", help="download a file")
    fetch.add_argument("name", metavar="NAME")
    fetch.add_argument("--out", type=Path, metavar="FILE", help="output file (default: NAME in the current folder)")
    for action in (start, stop, listed, fetch):
        add_rest_options(action)


def run(arguments: argparse.Namespace) -> None:
    """Run the action. Raises REFUSED."""
    {"start": _start, "stop": _stop, "list": _list, "fetch": _fetch}[arguments.action](arguments)


def _start(arguments: argparse.Namespace) -> None:
    state = asked(arguments, "POST", "/recordings", {"tags": arguments.tags or None})
    print(f"recording {'all tags' if state['tags'] is None else ', '.join(state['tags'])}")


def _stop(arguments: argparse.Namespace) -> None:
    state = asked(arguments, "POST", "/recordings/stop")
    print(f"stopped{'' if state['file'] is None else ': ' + state['file']}")


def _list(arguments: argparse.Namespace) -> None:
    found = asked(arguments, "GET", "/recordings")
    for file in found["files"]:
        print(f"{file['name']}  {file['bytes'] / 2**20:.1f} MiB{'' if file['finished'] else '  not finished'}")
    print("recording" if found["recording"] else "not recording")


def _fetch(arguments: argparse.Namespace) -> None:
    target = arguments.out or Path(Path(arguments.name).name)
    with opened(arguments, "GET", f"/recordings/{quote(arguments.name, safe='')}") as answer, target.open("wb") as file:
        shutil.copyfileobj(answer, file)
    print(target)
