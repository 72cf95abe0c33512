"""Tags that vanish silently, as when their Wi-Fi or power fails, delay no other tag.

Half of the tags are on another host, and its link stops forwarding packets. These tags no longer acknowledge what the
router sends, such as keep-alive messages. A router with too few receive threads would wait for them.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from threading import Lock

import pytest
import zenoh

from dropanchor_schemas.keys import all_tags, tag_from_key
from dropanchor_schemas.wire import Rejection, read_header
from support.commands import environment
from support.lossy_link import LossyLink, lossy_link
from support.secured import secured_site
from support.service import running_router, running_service
from support.zenoh_router import connected_session, free_port, wait_until

GONE = [f"gone-{number}" for number in range(int(os.environ.get("DROPANCHOR_VANISHING_TAGS", "12")))]
HERE = [f"here-{number}" for number in range(int(os.environ.get("DROPANCHOR_STAYING_TAGS", "12")))]
"""The figures in service/docs/results/survives.md are for 60 and 40. `pytest -s` prints them."""

HZ = 10
MAX_SILENCE_S = 8.0  # a receive thread that closes a connection waits for 10 s
AFTER_S = 2.0  # the observation continues so long after the router has closed the last connection

# Runs tags with a connection each until the process is killed. The first argument is an endpoint, or a folder with
# their credentials.
TAGS = f"""
import sys, time
from contextlib import AbstractContextManager, ExitStack
from dropanchor_tag_client import TagClient
from dropanchor_tag_client.credentials import read_credentials
target, *names = sys.argv[1:]
with ExitStack() as opened:
    tags = []
    for name in names:
        connect = target if target.startswith("tcp/") else read_credentials(f"{{target}}/{{name}}").session
        tags.append(opened.enter_context(TagClient(name, connect=connect, batch_samples=1, batch_s=None)))
    while True:
        for tag in tags:
            tag.publish_range(7, 10.0)
        time.sleep({1 / HZ})
"""


class TagActivity:
    """alive: tags whose liveliness token exists. longest_s: how long a message of each tag was under way, at most.

    The time between two messages would depend on how busy the machine is that sends them.
    """

    def __init__(self, session: zenoh.Session, site: str = "default") -> None:
        self.alive: set[str] = set()
        self.longest_s: dict[str, float] = {}
        self._last_ns: dict[str, int] = {}
        self._lock = Lock()
        self._subscribers = (
            session.declare_subscriber(all_tags(site, "samples"), self._on_sample),
            session.liveliness().declare_subscriber(all_tags(site, "alive"), self._on_token, history=True),
        )

    def reset(self) -> None:
        """Discard the delays so far."""
        with self._lock:
            self.longest_s.clear()

    def longest_of(self, tags: Sequence[str]) -> float:
        """Return the longest delay of any of these tags in s, including that of a message that has yet to come."""
        now_ns = time.time_ns()
        with self._lock:
            return max(max(self.longest_s.get(tag, 0.0), (now_ns - self._last_ns[tag]) / 1e9 - 1 / HZ) for tag in tags)

    def _on_sample(self, message: zenoh.Sample) -> None:
        tag, header = tag_from_key(str(message.key_expr)), read_header(bytes(message.payload))
        assert not isinstance(header, Rejection)
        sent_ns = header[-1]
        with self._lock:
            delay_s = (time.time_ns() - sent_ns) / 1e9
            self.longest_s[tag] = max(self.longest_s.get(tag, 0.0), delay_s)
            self._last_ns[tag] = sent_ns

    def _on_token(self, message: zenoh.Sample) -> None:
        tag = tag_from_key(str(message.key_expr))
        (self.alive.add if message.kind == zenoh.SampleKind.PUT else self.alive.discard)(tag)


@contextmanager
def publishing(target: str, tags: Sequence[str], link: LossyLink | None = None) -> Iterator[None]:
    """Run the tags in a process of their own. With a link, the process runs on the host at its other end."""
    command = [sys.executable, "-c", TAGS, target, *tags]
    with subprocess.Popen(link.elsewhere(*command) if link else command, env=environment()) as process:
        try:
            yield
        finally:
            process.kill()


def router_of(kind: str, *options: str, ca: Path | None = None) -> AbstractContextManager[object]:
    """Run a router of its own, or the one inside a service."""
    return running_router(*options) if kind == "router" else running_service(*options, ca=ca)


@contextmanager
def plain_router(kind: str, link: LossyLink) -> Iterator[tuple[zenoh.Session, str]]:
    """Run a router without security. Yield a session with it, and the endpoint for the tags."""
    endpoint = f"tcp/{link.here}:{free_port()}"
    options = ("--insecure", "--zenoh-listen", endpoint)
    with router_of(kind, *options), connected_session(endpoint) as session:
        yield session, endpoint


@contextmanager
def tls_router(kind: str, link: LossyLink, folder: Path) -> Iterator[tuple[zenoh.Session, str]]:
    """Run a router with TLS. Yield a session with it, and the folder with the credentials of the tags."""
    site = secured_site(folder, *GONE, *HERE, host=link.here, address=link.here)
    options = ("--security", str(folder), "--zenoh-listen", site.folder.table.listen[0])
    with router_of(kind, *options, ca=folder / "ca.pem"), site.session("service") as session:
        yield session, str(folder / "tags")


@pytest.mark.parametrize("security", ["plain", "tls"])
@pytest.mark.parametrize("kind", ["router", "serve"])
def test_tags_that_vanish_all_at_once_delay_no_other_tag(kind: str, security: str, tmp_path: Path) -> None:
    with ExitStack() as opened:
        link = opened.enter_context(lossy_link())
        router = plain_router(kind, link) if security == "plain" else tls_router(kind, link, tmp_path / "security")
        session, target = opened.enter_context(router)
        activity = TagActivity(session)
        opened.enter_context(publishing(target, GONE, link))
        opened.enter_context(publishing(target, HERE))
        wait_until(lambda: activity.alive >= {*GONE, *HERE} <= activity.longest_s.keys())
        activity.reset()
        link.loss = 1.0
        wait_until(lambda: not activity.alive & set(GONE), 240.0)
        time.sleep(AFTER_S)
        longest_s = activity.longest_of(HERE)
    print(f"{len(GONE)} of {len(GONE + HERE)} tags vanished, {kind}, {security}: others delayed by {longest_s:.2f} s")  # noqa: T201
    assert longest_s < MAX_SILENCE_S
