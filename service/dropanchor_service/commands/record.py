"""`dropanchor record`: control the recordings of a running service over its REST interface."""

import argparse
import json
import os
import shutil
import ssl
import sys
from http.client import HTTPException, HTTPResponse
from pathlib import Path
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import quote
from urllib.request import Request, urlopen

KEY_VARIABLE = "DROPANCHOR_API_KEY"
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
EXIT_ERROR = 2
TIMEOUT_S = 30.0


class RefusedError(Exception):
    """The service rejected the request or did not answer. The message says why."""


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
        action.add_argument("--url", default="http://127.0.0.1:8080", help="URL of the service (default: %(default)s)")
        action.add_argument("--ca", type=Path, metavar="FILE", help="CA certificate of the service, for https")


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Return 0, or 2 on an error."""
    try:
        {"start": _start, "stop": _stop, "list": _list, "fetch": _fetch}[arguments.action](arguments)
    except (RefusedError, OSError) as error:
        sys.stderr.write(f"dropanchor record: {error}\n")
        return EXIT_ERROR
    return 0


def _start(arguments: argparse.Namespace) -> None:
    state = _asked(arguments, "POST", "", {"tags": arguments.tags or None})
    print(f"recording {'all tags' if state['tags'] is None else ', '.join(state['tags'])}")


def _stop(arguments: argparse.Namespace) -> None:
    state = _asked(arguments, "POST", "/stop")
    print(f"stopped{'' if state['file'] is None else ': ' + state['file']}")


def _list(arguments: argparse.Namespace) -> None:
    found = _asked(arguments, "GET", "")
    for file in found["files"]:
        print(f"{file['name']}  {file['bytes'] / 2**20:.1f} MiB{'' if file['finished'] else '  not finished'}")
    print("recording" if found["recording"] else "not recording")


def _fetch(arguments: argparse.Namespace) -> None:
    target = arguments.out or Path(Path(arguments.name).name)
    with _opened(arguments, "GET", f"/{quote(arguments.name, safe='')}") as answer, target.open("wb") as file:
        shutil.copyfileobj(answer, file)
    print(target)


def _asked(arguments: argparse.Namespace, method: str, path: str, body: Any = None) -> Any:
    with _opened(arguments, method, path, body) as answer:
        return json.load(answer)


def _opened(arguments: argparse.Namespace, method: str, path: str, body: Any = None) -> HTTPResponse:
    headers = {"content-type": "application/json"}
    if os.environ.get(KEY_VARIABLE):
        headers["authorization"] = f"Bearer {os.environ[KEY_VARIABLE]}"
    data = None if body is None else json.dumps(body).encode()
    url = f"{arguments.url.rstrip('/')}/api/v1/recordings{path}"
    trusted = ssl.create_default_context(cafile=arguments.ca) if url.startswith("https:") else None
    try:
        request = Request(url, data, headers, method=method)
        answer: HTTPResponse = urlopen(request, timeout=TIMEOUT_S, context=trusted)
    except HTTPError as error:
        with error:
            raise RefusedError(_reason(error)) from error
    except (URLError, HTTPException, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise RefusedError(f"{arguments.url} does not answer ({reason}): check --url and that it runs") from error
    return answer


def _reason(error: HTTPError) -> str:
    try:
        return str(json.load(error)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"{error.code} {error.reason}"
