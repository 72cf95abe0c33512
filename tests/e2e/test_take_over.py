"""Two services and a database: the second one serves the sites when the first one dies, freezes or hands them over."""

import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import NamedTuple, Self

import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.epochs import EpochFence
from dropanchor_service.api.routes import event_examples
from dropanchor_service.commands.serve import EXIT_GONE
from support.commands import Ended
from support.live_tags import LiveTags, distance, fused, is_current, poses_of, samples_of
from support.patience import PATIENCE_S
from support.postgresql import Postgresql, needs_postgresql, running_postgresql
from support.relay import running_relay
from support.service import Running, ended, running_service
from support.zenoh_router import connected_session, wait_until

TAGS = 3
LEASE_S = 2.0


class Received(NamedTuple):
    """A pose that came over Zenoh. at_s: when, monotonic."""

    at_s: float
    epoch: int
    is_accepted: bool


class Reader:
    """A reader of the poses of all tags, which drops those of former owners."""

    def __init__(self) -> None:
        self._fence = EpochFence()
        self._lock = Lock()
        self.poses: list[Received] = []

    @contextmanager
    def subscribed(self, session: zenoh.Session) -> Iterator[Self]:
        subscriber = session.declare_subscriber(keys.all_tags("default", "pose"), self._on_pose)
        yield self
        subscriber.undeclare()

    def _on_pose(self, message: zenoh.Sample) -> None:
        epoch = json.loads(message.payload.to_bytes())["epoch"]
        with self._lock:
            self.poses.append(Received(time.monotonic(), epoch, self._fence.accepts("default", epoch)))

    def longest_silence_s(self, since_s: float) -> float:
        """Return the longest time without an accepted pose."""
        with self._lock:
            times = [pose.at_s for pose in self.poses if pose.is_accepted and pose.at_s > since_s - 0.5]
        return max(later - earlier for earlier, later in pairwise(times))


class Cluster:
    """Services that are named a and b, with the sites of the tags."""

    def __init__(self, folder: Path, database: Postgresql, router: str, tags: LiveTags, opened: ExitStack) -> None:
        self._folder = folder
        self._router = router
        self._opened = opened
        self.database = database
        self._tags = tags
        for name in "ab":
            (folder / name).mkdir()
            self.config = self._write_settings(name, database.port)

    def _write_settings(self, name: str, port: int) -> Path:
        url = self.database.url().replace(str(self.database.port), str(port))
        cluster = (f'url = "{url}"', 'bucket = "yard"', f'name = "{name}"', f"lease_s = {LEASE_S}")
        return self._tags.write_settings(self._folder / name, "[cluster]", *cluster)

    def start(self, name: str, port: int | None = None) -> Running:
        """Start a service. port: where it reaches the database, if not at its own."""
        config = self._write_settings(name, port or self.database.port)
        options = ("--config", str(config), "--data-dir", str(self._folder / name / "data"))
        service = running_service(*options, "--zenoh-connect", self._router, ready=False)
        return self._opened.enter_context(service)

    def run(self, *arguments: str) -> Ended:
        return ended("cluster", *arguments, "--url", self.database.url())


def readiness(service: Running) -> str:
    return service.ask("GET", "/api/v1/health/ready").text


def wait_for(service: Running, *words: str) -> None:
    wait_until(lambda: all(word in readiness(service) for word in words))


def wait_until_gone(service: Running) -> None:
    assert service.process.wait(PATIENCE_S) == EXIT_GONE, "".join(service.log)
    wait_until(lambda: any("Started again, this process is a standby" in line for line in service.log))


@needs_postgresql
def test_each_failure_of_an_owner_leaves_one_owner_and_loses_no_sample(
    tmp_path: Path, router_endpoint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    silences: dict[str, float] = {}
    reader = Reader()

    def measured(what: str, service: Running, failure: Callable[[], None]) -> None:
        """Let it happen, wait until the service serves, and note how long no pose came."""
        began_s = time.monotonic()
        failure()
        wait_until(lambda: service.ask("GET", "/api/v1/health/ready").status_code == 200)
        wait_until(lambda: is_current(service, TAGS))
        silences[what] = reader.longest_silence_s(began_s)

    with ExitStack() as opened:
        database = opened.enter_context(running_postgresql())
        tags = LiveTags(router_endpoint, TAGS, seed=5)
        cluster = Cluster(tmp_path, database, router_endpoint, tags, opened)
        session = opened.enter_context(connected_session(router_endpoint))
        opened.enter_context(reader.subscribed(session))
        a = cluster.start("a")
        wait_for(a, '"ready"')
        b = cluster.start("b")
        wait_for(b, "standby of yard: the owner is a, epoch 1")
        opened.enter_context(tags)
        wait_until(lambda: is_current(a, TAGS))

        a.put("/api/v1/zones/dock", event_examples.ZONE)
        a.put("/api/v1/anchors/9", {"id": "9", "x": 50.0})

        measured("database away for 5 s", a, lambda: _database_away(database, a, b))
        assert not [pose for pose in reader.poses if pose.epoch != 1]

        measured("owner frozen", b, lambda: a.process.send_signal(signal.SIGSTOP))
        a.process.send_signal(signal.SIGCONT)
        wait_until_gone(a)

        a = cluster.start("a")
        wait_for(a, "standby of yard: the owner is b, epoch 2")
        measured("moved", a, lambda: _moved(cluster))
        wait_until_gone(b)

        network = opened.enter_context(running_relay(database.port))
        b = cluster.start("b", network.port)
        wait_for(b, "standby of yard: the owner is a, epoch 3")
        measured("owner killed", b, a.process.kill)

        a = cluster.start("a")
        wait_for(a, "standby of yard: the owner is b, epoch 4")
        measured("owner cut off from the database", a, network.silent.set)
        wait_until_gone(b)

        tags.finish()
        wait_until(lambda: samples_of(a) == tags.samples)
        expected = tags.expected(cluster.config)
        answers = fused(expected, partial(poses_of, a))
        status = cluster.run("status").stdout
        anchors = sorted(anchor["id"] for anchor in a.get("/api/v1/site")["anchors"])
        zones = [zone["id"] for zone in a.get("/api/v1/zones")["zones"]]
    dropped = sum(not pose.is_accepted for pose in reader.poses)
    lines = [f"{what}: {silence_s:.2f} s without a pose" for what, silence_s in silences.items()]
    with capsys.disabled():
        sys.stdout.write("\n".join(["", *lines, f"poses of former owners that were dropped: {dropped}", ""]))
    assert (anchors, zones) == (["1", "9"], ["dock"])
    assert "yard: epoch 5\n  owner: a" in status
    assert {pose["epoch"] for pose in answers.values()} == {5}
    assert max(distance(pose, answers[tag]) for tag, pose in expected.items()) < 0.01
    accepted = [pose.epoch for pose in reader.poses if pose.is_accepted]
    assert accepted == sorted(accepted)


def _database_away(database: Postgresql, owner: Running, standby: Running) -> None:
    database.stop()
    wait_for(owner, '"ready"', "goes on as the owner of yard, epoch 1, until another one takes over")
    wait_for(standby, "cannot reach the database")
    time.sleep(2.5 * LEASE_S)
    assert '"ready"' in readiness(owner)
    database.start()
    wait_for(owner, '"impaired":[]')
    time.sleep(1.5 * LEASE_S)  # the standby looks again, and must not take over


def _moved(cluster: Cluster) -> None:
    moved = cluster.run("move", "yard")
    assert "yard is owned by a now, epoch 3" in moved.stdout, moved.stderr
