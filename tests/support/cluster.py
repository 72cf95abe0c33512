"""Run a cluster on loopback: each node has an address of its own, since Ray takes two with one address for one."""

import importlib.util
import os
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from psycopg.errors import UndefinedTable

from support.kernel_cache import compile_once
from support.postgresql import Postgresql
from support.service import command, environment
from support.zenoh_router import free_port

needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'dropanchor-service[cluster]'"
)


class Cluster:
    """Nodes with these settings of sites. folder: short, because of the sockets of Ray. head: its address and port."""

    def __init__(self, folder: Path, database: Postgresql, router: str, sites: Sequence[str]) -> None:
        self.folder = folder
        self._database = database
        self._lines = ["[zenoh]", f'connect = ["{router}"]', *sites]
        self._port = free_port()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, number: int, *options: str) -> "subprocess.Popen[bytes]":
        """Start a node at 127.0.0.`number`. Without options, it joins the head."""
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        config = folder / "sites.toml"
        cluster = ["[cluster]", f'url = "{self._database.url()}"', f'name = "{name}"']
        config.write_text("\n".join(["history.enabled = false", *cluster, *self._lines]) + "\n")
        words = ["--config", str(config), "--folder", str(folder), "--token", str(self.folder / "token")]
        role = options or ("--join",)
        port = ["--port", str(self._port)] if "--head" in role else []
        where = ["--address", f"127.0.0.{number}", *role, *port]
        with (folder / "log").open("ab") as log:
            process = subprocess.Popen(
                command("cluster", "start", *words, *where), env=environment(), stderr=log, stdout=log
            )
        self._processes[name] = process
        return process

    def kill(self, name: str) -> None:
        """Kill all processes of a node at once."""
        self.send(name, signal.SIGKILL)
        self._processes.pop(name).wait()

    def send(self, name: str, how: signal.Signals) -> None:
        """Send a signal to all processes of a node."""
        process = self._processes[name]
        for number in [process.pid, *_descendants(process.pid)]:
            with suppress(ProcessLookupError):
                os.kill(number, how)

    def kill_raylet(self, name: str) -> None:
        """Kill the process of Ray that starts all others of a node."""
        for number, line in _descendants(self._processes[name].pid).items():
            if "raylet/raylet" in line:
                os.kill(number, signal.SIGKILL)

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
        return self._processes[name].wait(60)

    def owners(self) -> dict[str, str]:
        """Return the shard that owns each bucket."""
        return dict(self._rows("SELECT bucket, owner FROM dropanchor_lease WHERE owner <> '' AND bucket <> '@head'"))

    def has_head(self) -> bool:
        return bool(self._rows("SELECT 1 FROM dropanchor_lease WHERE bucket = '@head' AND owner <> ''"))

    def address(self, bucket: str) -> str:
        """Return the address of the page of the owner."""
        return str(dict(self._rows("SELECT bucket, address FROM dropanchor_lease"))[bucket])

    def standbys(self) -> list[str]:
        """Return the shards that stand by."""
        statement = """SELECT name FROM dropanchor_standby WHERE seen > clock_timestamp() - interval '2 s'
            AND bucket = '*' AND obstacle = '' AND name NOT IN (SELECT owner FROM dropanchor_lease)"""
        return sorted(name for (name,) in self._rows(statement))

    def _rows(self, statement: str) -> list[tuple[Any, ...]]:
        with suppress(UndefinedTable):  # the first process makes the tables
            return self._database.run(self._database.url(), statement)
        return []

    def run(self, *arguments: str) -> "subprocess.CompletedProcess[str]":
        """Run `dropanchor cluster` and return what it said."""
        words = command("cluster", *arguments, "--url", self._database.url())
        return subprocess.run(words, capture_output=True, text=True, env=environment(), check=False, timeout=90)

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


def _descendants(process: int) -> dict[int, str]:
    """Return the children of a process, theirs and so on, each with its command line."""
    found: dict[int, str] = {}
    with suppress(OSError):
        for child in Path(f"/proc/{process}/task/{process}/children").read_text().split():
            found[int(child)] = Path(f"/proc/{child}/cmdline").read_bytes().replace(b"\0", b" ").decode()
            found |= _descendants(int(child))
    return found


@contextmanager
def running_cluster(database: Postgresql, router: str, sites: Sequence[str]) -> Iterator[Cluster]:
    """Give a cluster without nodes, and end all of its nodes after the block."""
    compile_once()
    with tempfile.TemporaryDirectory(prefix="dr-", dir="/tmp", ignore_cleanup_errors=True) as folder:
        cluster = Cluster(Path(folder), database, router, sites)
        try:
            yield cluster
        finally:
            cluster.close()
