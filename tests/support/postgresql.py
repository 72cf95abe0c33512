"""Run Debian's PostgreSQL on loopback, without fsync, and make databases in it."""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import psycopg
import pytest

from support.zenoh_router import free_port, wait_until

_DEBIAN = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
_INITDB = str(_DEBIAN[-1]) if _DEBIAN else shutil.which("initdb")
WHY_NOT = "PostgreSQL is not installed: apt-get install postgresql"
needs_postgresql = pytest.mark.skipif(_INITDB is None, reason=WHY_NOT)
_USER = "postgres"  # whom Debian's package makes: PostgreSQL refuses to run as root
_QUICK = (
    "fsync=off",
    "shared_buffers=32MB",
    "unix_socket_directories=",
    "autovacuum=off",
)
_numbers = count()


@dataclass
class Postgresql:
    """A server. The role `dropanchor` may do everything. host: address where it listens."""

    folder: Path
    options: tuple[str, ...] = ()
    host: str = "127.0.0.1"
    port: int = field(default_factory=free_port)
    process: "subprocess.Popen[bytes] | None" = None

    def start(self) -> None:
        options = [
            word for option in (*_QUICK, f"listen_addresses={self.host}", *self.options) for word in ("-c", option)
        ]
        command = [_program("postgres"), "-D", f"{self.folder}/data", "-p", str(self.port), *options]
        log = self.folder / "log"
        with log.open("ab") as file:
            self.process = subprocess.Popen(command, stderr=file, stdout=file, user=_user(), group=_group())
        wait_until(self._answers)

    def stop(self) -> None:
        """Stop the server at once, and end its connections."""
        if self.process is not None:
            self.process.send_signal(signal.SIGINT)
            self.process.wait()
            self.process = None

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Stop all processes of the server in this context, as a machine does that swaps or is paused."""
        assert self.process is not None
        parent = self.process.pid
        os.kill(parent, signal.SIGSTOP)  # first, so that it starts no other
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
        pids = [parent, *map(int, children)]

        def send(number: signal.Signals) -> None:
            for pid in pids:
                with suppress(ProcessLookupError):  # one that served a connection may end by itself
                    os.kill(pid, number)

        send(signal.SIGSTOP)
        try:
            yield
        finally:
            send(signal.SIGCONT)

    def url(self, database: str = "postgres", user: str = "dropanchor") -> str:
        return f"postgresql://{user}@{self.host}:{self.port}/{database}"

    def new_database(self) -> str:
        """Return the URL of an empty database."""
        name = f"d{next(_numbers)}"
        self.run(self.url(), f"CREATE DATABASE {name}")
        return self.url(name)

    def connect(self, url: str | None = None) -> "psycopg.Connection[tuple[Any, ...]]":
        return psycopg.connect(url or self.url(), autocommit=True)

    def run(self, url: str, *statements: str) -> list[tuple[Any, ...]]:
        """Run SQL and return the rows of the last statement."""
        with self.connect(url) as connection:
            for statement in statements:
                cursor = connection.execute(statement)
            return cursor.fetchall() if cursor.description else []

    def _answers(self) -> bool:
        try:
            return self.run(self.url(), "SELECT 1") == [(1,)]
        except psycopg.OperationalError:
            return False


@contextmanager
def running_postgresql(*options: str, host: str = "127.0.0.1") -> Iterator[Postgresql]:
    """Run a server until the block ends. Whoever is in the network of `host` may connect."""
    folder = Path(tempfile.mkdtemp(prefix="dropanchor-pg-"))
    server = Postgresql(folder, options, host)
    try:
        if _user() is not None:
            shutil.chown(folder, _USER)
        make = [_program("initdb"), "-D", f"{folder}/data", "--no-sync", "-A", "trust", "-U", "dropanchor"]
        subprocess.run(
            [*make, "--locale=C", "-E", "UTF8"],
            check=True,
            capture_output=True,
            user=_user(),
            group=_group(),
            cwd=folder,
        )
        with (folder / "data" / "pg_hba.conf").open("a") as rules:
            rules.write("host all all samenet trust\n")
        server.start()
        yield server
    finally:
        server.stop()
        shutil.rmtree(folder)


def _program(name: str) -> str:
    assert _INITDB is not None, WHY_NOT
    return str(Path(_INITDB).with_name(name))


def _user() -> int | None:
    return pwd.getpwnam(_USER).pw_uid if os.geteuid() == 0 else None


def _group() -> int | None:
    return pwd.getpwnam(_USER).pw_gid if os.geteuid() == 0 else None
