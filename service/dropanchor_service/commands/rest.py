"""Requests of a command to the REST interface of a running service."""

import argparse
import json
import os
import ssl
from http.client import HTTPException, HTTPResponse
from pathlib import Path
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

KEY_VARIABLE = "DROPANCHOR_API_KEY"
TIMEOUT_S = 30.0


class RefusedError(Exception):
    """The service rejected the request or did not answer. The message says why. status: of HTTP; 0 without an answer"""

    status = 0


def add_rest_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="URL of the service (default: %(default)s)")
    parser.add_argument("--ca", type=Path, metavar="FILE", help="CA certificate of the service, for https")


def asked(arguments: argparse.Namespace, method: str, path: str, body: Any = None, timeout_s: float = TIMEOUT_S) -> Any:
    """Return the JSON of the answer. path: after `/api/v1`. Raises RefusedError."""
    with opened(arguments, method, path, body, timeout_s) as answer:
        try:
            return json.load(answer)
        except (OSError, HTTPException, ValueError) as error:
            raise RefusedError(f"{arguments.url} gave no complete answer ({error})") from error


def opened(
    arguments: argparse.Namespace, method: str, path: str, body: Any = None, timeout_s: float = TIMEOUT_S
) -> HTTPResponse:
    """Return the answer, to be read and closed. Raises RefusedError."""
    headers = {"content-type": "application/json"}
    if os.environ.get(KEY_VARIABLE):
        headers["authorization"] = f"Bearer {os.environ[KEY_VARIABLE]}"
    data = None if body is None else json.dumps(body).encode()
    url = f"{arguments.url.rstrip('/')}/api/v1{path}"
    trusted = ssl.create_default_context(cafile=arguments.ca) if url.startswith("https:") else None
    try:
        request = Request(url, data, headers, method=method)
        answer: HTTPResponse = urlopen(request, timeout=timeout_s, context=trusted)
    except HTTPError as error:
        with error:
            refused = RefusedError(_reason(error))
        refused.status = error.code
        raise refused from error
    except (URLError, HTTPException, OSError, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise RefusedError(f"{arguments.url} does not answer ({reason}): check --url and that it runs") from error
    return answer


def _reason(error: HTTPError) -> str:
    try:
        return str(json.load(error)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"{error.code} {error.reason}"
