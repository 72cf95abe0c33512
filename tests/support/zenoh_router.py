"""Run real Zenoh routers on loopback, and wait for conditions."""

import functools
import itertools
import json
import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import zenoh

from support.patience import PATIENCE_S

T = TypeVar("T")

_ROUTER_PROGRAM = """
import sys, zenoh
with zenoh.open(zenoh.Config.from_json5(sys.argv[1])):
    print("up", flush=True)
    sys.stdin.read()
"""


@functools.cache
def _ports() -> Iterator[int]:
    """Yield candidate ports. They lie below the kernel's ephemeral ports, and each test worker has its own."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    ports = range(10_000, 32_000)[worker::workers]
    begin = random.randrange(len(ports))  # so that two test runs on one machine rarely collide
    return itertools.cycle((*ports[begin:], *ports[:begin]))


def free_port() -> int:
    """Return a free port on loopback that no other caller in this test run gets."""
    return next(port for port in _ports() if _is_free(port))


def _is_free(port: int) -> bool:
    with socket.socket() as probe, suppress(OSError):
        probe.bind(("127.0.0.1", port))
        return True
    return False


def free_endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


def configuration(mode: str, endpoints: list[str], extra: dict[str, Any] | None = None) -> str:
    """Return the JSON5 of a router that listens at the endpoints, or of a client that connects to one of them."""
    retry = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
    connect = {"endpoints": endpoints, "timeout_ms": round(1000 * PATIENCE_S), "exit_on_failure": True, "retry": retry}
    role = {"listen": {"endpoints": endpoints}} if mode == "router" else {"connect": connect}
    drop = {"wait_before_drop": round(1e6 * PATIENCE_S), "max_wait_before_drop_fragments": round(1e6 * PATIENCE_S)}
    patient = {"link": {"tx": {"queue": {"congestion_control": {"drop": drop}}}}}  # a busy machine drops no put
    quiet = {"scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}}}
    transport = {"shared_memory": {"enabled": False}, **(patient if mode == "client" else {}), **(extra or {})}
    unstamped = {"timestamping": {"enabled": False}}
    return json.dumps({"mode": mode, **role, **quiet, **unstamped, "transport": transport})


@contextmanager
def running_router(endpoints: str | list[str], extra: dict[str, Any] | None = None) -> Iterator[zenoh.Session]:
    """Run a router inside this process until the block ends. extra: for the transport section of its configuration."""
    listed = [endpoints] if isinstance(endpoints, str) else endpoints
    with zenoh.open(zenoh.Config.from_json5(configuration("router", listed, extra))) as session:
        yield session


@contextmanager
def connected_session(endpoint: str) -> Iterator[zenoh.Session]:
    """Open a client session until the block ends."""
    with zenoh.open(zenoh.Config.from_json5(configuration("client", [endpoint]))) as session:
        yield session


def make_known(session: zenoh.Session) -> None:
    """Return once the router knows all that the session has declared: after a round trip."""
    list(session.get("nobody/answers", timeout=PATIENCE_S))


def start_router_process(endpoint: str) -> subprocess.Popen[str]:
    """Start a router in a process of its own, which a test can kill. The caller ends it."""
    command = [sys.executable, "-c", _ROUTER_PROGRAM, configuration("router", [endpoint])]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n", "the router did not start"
    return process


@contextmanager
def router_process(endpoint: str) -> Iterator["subprocess.Popen[str]"]:
    """Run a router in a process of its own until the block ends."""
    router = start_router_process(endpoint)
    try:
        yield router
    finally:
        router.kill()
        router.communicate()


@contextmanager
def dropping_router(key: str) -> Iterator[str]:
    """Run a router that delivers the first put on the key and drops those that follow within a minute."""
    endpoint = free_endpoint()
    rules = [{"key_expr": key, "freq": 1 / 60}]
    dropped = {"downsampling": [{"id": "drop", "messages": ["put"], "flows": ["egress"], "rules": rules}]}
    config = json.dumps(json.loads(configuration("router", [endpoint])) | dropped)
    with zenoh.open(zenoh.Config.from_json5(config)):
        yield endpoint


def wait_until(condition: Callable[[], T], timeout_s: float = PATIENCE_S) -> T:
    """Wait until what the condition returns is true, and return it: asked again, it may be something else.

    Fail the test when it is still false after `timeout_s`.
    """
    deadline, pause_s = time.monotonic() + timeout_s, 0.005
    while not (found := condition()):
        assert time.monotonic() < deadline, f"not within {timeout_s} s"
        time.sleep(pause_s)
        pause_s = min(1.5 * pause_s, 0.1)  # a condition may cost much more than the pause, here and in the service
    return found
