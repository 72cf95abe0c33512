"""Read the stream of poses of a server on loopback."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx

from dropanchor_service.api.http.limits import GuardedProtocol
from support.api import ApiBench
from support.http_server import running_server


@contextmanager
def serving(bench: ApiBench, protocol: type[GuardedProtocol] = GuardedProtocol) -> Iterator[int]:
    """Serve the interface of the bench until the block ends. Yield the port."""
    with running_server(bench.app(), bench.stopping, protocol=protocol) as port:
        yield port


@contextmanager
def streaming(port: int, query: str = "max_hz=30") -> Iterator[Iterator[tuple[str, Any]]]:
    """Open a stream and yield its events: name and frame. A comment has an empty name."""
    url = f"http://127.0.0.1:{port}/api/v1/stream?{query}"
    with httpx.Client(trust_env=False, verify=False) as client, client.stream("GET", url) as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        yield _events(response)


def _events(response: httpx.Response) -> Iterator[tuple[str, Any]]:
    name = ""
    for line in response.iter_lines():
        if line.startswith("event: "):
            name = line[7:]
        elif line.startswith("data: "):
            yield name, json.loads(line[6:])
        elif line.startswith(":"):
            yield "", line


def get(port: int, path: str = "/api/v1/health/live") -> httpx.Response:
    return httpx.get(f"http://127.0.0.1:{port}{path}", trust_env=False, verify=False)
