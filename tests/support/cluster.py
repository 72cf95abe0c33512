"""Run a cluster on loopback: each node has an address of its own, since Ray takes two with one address for one."""

import importlib.util
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

import pytest
from psycopg.errors import UndefinedTable

from support.kernel_cache import compile_once
from support.patience import PATIENCE_S
from support.postgresql import Postgresql
from support.service import command, environment
from support.zenoh_router import free_port, wait_until

needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'dropanchor-service[cluster]'"
)


class Machines(Protocol):
    """Where nodes run, by their numbers."""

    def address(self, number: int) -> str: ...

    def command(self, number: int, words: Sequence[str]) -> list[str]:
        """Return the command that runs these words on a machine."""
        ...

    def settings(self, number: int) -> list[str]:
        """Return settings of a machine, for the top of the file."""
        ...


class Loopback:
    """Addresses of the loopback in place of machines."""

    def address(self, number: int) -> str:
        return f"127.0.0.{number}"

    def command(self, _: int, words: Sequence[str]) -> list[str]:
        return list(words)

    def settings(self, _: int) -> list[str]:
        return []


class Cluster:
    """Nodes with these settings of sites. folder: short, because of Ray's sockets. more: settings of the cluster."""

    def __init__(
        self, folder: Path, database: Postgresql, router: str, sites: Sequence[str], machines: Machines
    ) -> None:
        self.folder = folder
        self._machines = machines
        self._database = database
        self._lines = ["[zenoh]", f'connect = ["{router}"]', *sites]
        self._port = free_port()
        self.more: Sequence[str] = ()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._started: dict[str, tuple[int, tuple[str, ...]]] = {}

    def start(self, name: str, number: int, *options: str) -> "subprocess.Popen[bytes]":
        """Start a node on the machine `number`. Without options, it joins the head."""
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        config = folder / "sites.toml"
        cluster = ["[cluster]", f'url = "{self._database.url()}"', f'name = "{name}"', *self.more]
        lines = ["history.enabled = false", *self._machines.settings(number), *cluster, *self._lines]
        config.write_text("\n".join(lines) + "\n")
        words = ["--config", str(config), "--folder", str(folder), "--token", str(self.folder / "token")]
        role = options or ("--join",)
        port = ["--port", str(self._port)] if "--head" in role else []
        where = ["--address", self._machines.address(number), *role, *port]
        start = self._machines.command(number, command("cluster", "start", *words, *where))
        with (folder / "log").open("ab") as log:
            process = subprocess.Popen(start, env=self._environment(name), stderr=log, stdout=log)
        self._processes[name] = process
        self._started[name] = number, options
        return process

    def restart_ended(self) -> None:
        """Start the nodes again whose process has ended, as a service manager does."""
        for name, process in list(self._processes.items()):
            if process.poll() is not None:
                number, options = self._started[name]
                self.start(name, number, *options)

    def install(self, name: str, version: str) -> None:
        """Do on a node what pip does at the end of an update: name the new version beside the packages."""
        packages = self._packages(name)
        named = packages / f"dropanchor_service-{version}.dist-info"
        named.mkdir(parents=True)
        (named / "METADATA").write_text(f"Metadata-Version: 2.1\nName: dropanchor-service\nVersion: {version}\n")
        for other in set(packages.iterdir()) - {named}:
            shutil.rmtree(other)

    def _packages(self, name: str) -> Path:
        return self.folder / name / "packages"

    def _environment(self, name: str) -> dict[str, str]:
        """Return the environment of the programs of a node. What is installed there comes before our own packages."""
        ours = environment()
        return ours | {"PYTHONPATH": os.pathsep.join([str(self._packages(name)), ours["PYTHONPATH"]])}

    def kill(self, name: str) -> None:
        """Kill all processes of a node at once."""
        self.send(name, signal.SIGKILL)
        self._processes.pop(name).wait()

    def send(self, name: str, how: signal.Signals) -> None:
        """Send a signal to all processes of a node."""
        process = self._processes[name]
        for number in [process.pid, *descendants(process.pid)]:
            with suppress(ProcessLookupError):
                os.kill(number, how)

    def stop(self, name: str) -> None:
        """Stop a node as an operator does."""
        self._processes[name].terminate()
        self._processes.pop(name).wait(PATIENCE_S)

    def kill_raylet(self, name: str) -> None:
        """Kill the process of Ray that starts the shards of a node, and wait until they have ended."""
        every = descendants(self._processes[name].pid).items()
        raylet = next(number for number, line in every if "raylet/raylet" in line)
        shards = descendants(raylet)
        os.kill(raylet, signal.SIGKILL)
        wait_until(lambda: not any(map(_runs, shards)))

    def processes(self) -> dict[int, str]:
        """Return all processes of all nodes, each with its command line."""
        started = [process.pid for process in self._processes.values()]
        below = [item for number in started for item in descendants(number).items()]
        return dict.fromkeys(started, "") | dict(below)

    def signal_shard(self, shard: str, bucket: str, how: signal.Signals) -> None:
        """Send a signal to the process of a shard that serves a bucket."""
        os.kill(self.process_of(shard, bucket), how)

    def process_of(self, shard: str, bucket: str) -> int:
        """Return the process of a shard that serves a bucket: the name of its log ends with its number."""
        logs = (self.folder / shard.partition("/")[0]).glob("ray/session_latest/logs/worker-*.err")
        serving = [log for log in logs if f"{shard} serves {bucket} " in log.read_text()]
        newest = max(serving, key=lambda log: log.stat().st_mtime)
        return int(newest.stem.rpartition("-")[2])

    def wait(self, name: str) -> int:
        """Wait until the process of a node ends, and return its exit code."""
        return self._processes[name].wait(PATIENCE_S)

    def owners(self) -> dict[str, str]:
        """Return the shard that owns each bucket."""
        return dict(self._rows("SELECT bucket, owner FROM dropanchor_lease WHERE owner <> '' AND bucket <> '@head'"))

    def has_head(self) -> bool:
        """Return whether a head has renewed its lease a moment ago."""
        statement = """SELECT 1 FROM dropanchor_lease WHERE bucket = '@head' AND owner <> ''
            AND renewed > clock_timestamp() - interval '2 s'"""
        return bool(self._rows(statement))

    def head_sees_nodes(self) -> bool:
        """Return whether the head has seen a node lately."""
        return bool(self._rows("SELECT 1 FROM dropanchor_node WHERE seen > clock_timestamp() - interval '2 s'"))

    def address(self, bucket: str) -> str:
        """Return the address of the page of the owner, once it has told it."""
        statement = "SELECT bucket, address FROM dropanchor_lease"
        return str(wait_until(lambda: dict(self._rows(statement)).get(bucket)))

    def standbys(self) -> list[str]:
        """Return the shards that stand by."""
        statement = """SELECT name FROM dropanchor_standby WHERE seen > clock_timestamp() - interval '2 s'
            AND bucket = '*' AND obstacle = '' AND name NOT IN (SELECT owner FROM dropanchor_lease)"""
        return sorted(name for (name,) in self._rows(statement))

    def installed_on(self, node: str) -> set[str]:
        """Return what the shards of a node say would run after a new start. They look about once a second."""
        rows = self._rows(
            "SELECT name, installed FROM dropanchor_standby WHERE seen > clock_timestamp() - interval '2 s'"
        )
        return {str(version) for name, version in rows if str(name).startswith(f"{node}/")}

    def _rows(self, statement: str) -> list[tuple[Any, ...]]:
        with suppress(UndefinedTable):  # the first process makes the tables
            return self._database.run(self._database.url(), statement)
        return []

    def run(self, *arguments: str, node: str = "head", limit_s: float = 90) -> "subprocess.CompletedProcess[str]":
        """Run `dropanchor cluster` on a node and return what it said."""
        words, there = command("cluster", *arguments, "--url", self._database.url()), self._environment(node)
        return subprocess.run(words, capture_output=True, text=True, env=there, check=False, timeout=limit_s)

    def count_said(self, name: str, words: str) -> int:
        """Return how often the process of a node has logged these words."""
        return (self.folder / name / "log").read_text(errors="replace").count(words)

    def log(self) -> str:
        """Return what the nodes and their shards have said."""
        files = sorted(
            [
                *self.folder.glob("*/log"),
                *self.folder.glob("*/ray.log"),
                *self.folder.glob("*/ray/session_latest/logs/worker-*.err"),
            ]
        )
        return "\n".join(f"== {file}\n{file.read_text(errors='replace')[-4000:]}" for file in files)

    def close(self) -> None:
        for name in list(self._processes):
            self.kill(name)


def _runs(process: int) -> bool:
    """Return whether a process has not ended, even if nobody has noticed its end yet."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


def descendants(process: int) -> dict[int, str]:
    """Return the children of a process, theirs and so on, each with its command line."""
    found: dict[int, str] = {}
    with suppress(OSError):
        for child in Path(f"/proc/{process}/task/{process}/children").read_text().split():
            found[int(child)] = Path(f"/proc/{child}/cmdline").read_bytes().replace(b"\0", b" ").decode()
            found |= descendants(int(child))
    return found


@contextmanager
def running_cluster(
    database: Postgresql, router: str, sites: Sequence[str], machines: Machines | None = None
) -> Iterator[Cluster]:
    """Give a cluster without nodes, and end all of its nodes after the block."""
    compile_once()
    with tempfile.TemporaryDirectory(prefix="dr-", dir="/tmp", ignore_cleanup_errors=True) as folder:
        cluster = Cluster(Path(folder), database, router, sites, machines or Loopback())
        try:
            yield cluster
        finally:
            cluster.close()
