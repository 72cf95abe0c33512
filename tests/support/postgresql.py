"""Run Debian's PostgreSQL on loopback, in a folder of its own."""

import os
import pwd
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import psycopg
import pytest

from support.zenoh_router import free_port, wait_until

USER = "postgres"  # the server refuses to run as root


@cache
def _programs() -> Path | None:
    """Return the folder with `initdb` and `postgres`, None if they are not installed."""
    found = [*sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)]
    on_path = shutil.which("initdb")
    return next((folder for folder in [*found, *([Path(on_path).parent] if on_path else [])]), None)


needs_postgresql = pytest.mark.skipif(
    _programs() is None, reason="PostgreSQL is not installed: apt-get install postgresql"
)


@dataclass
class PostgreSql:
    """A server. url: of its database `postgres`."""

    folder: Path
    port: int
    process: "subprocess.Popen[bytes] | None" = None

    @property
    def url(self) -> str:
        return f"postgresql://{USER}@127.0.0.1:{self.port}/postgres"

    def start(self) -> None:
        """Start the server, and wait until it answers."""
        options = ("-c", "listen_addresses=127.0.0.1", "-c", "unix_socket_directories=", "-c", "fsync=off")
        words = [str(_program("postgres")), "-D", str(self.folder), "-p", str(self.port), *options]
        self.process = subprocess.Popen(words, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, user=_user())
        wait_until(self._answers)

    def stop(self) -> None:
        """Stop the server as a crash does."""
        if self.process is not None:
            self.process.send_signal(signal.SIGQUIT)
            self.process.wait(30)
            self.process = None

    def connect(self) -> "psycopg.Connection[tuple[object, ...]]":
        return psycopg.connect(self.url, autocommit=True)

    def _answers(self) -> bool:
        try:
            self.connect().close()
        except psycopg.OperationalError:
            return False
        return True


@contextmanager
def running_postgresql() -> Iterator[PostgreSql]:
    """Run a server with an empty database until the block ends."""
    with TemporaryDirectory(prefix="postgresql-") as folder:
        if os.geteuid() == 0:
            os.chown(folder, pwd.getpwnam(USER).pw_uid, -1)
        words = [
            str(_program("initdb")),
            "-D",
            folder,
            "-U",
            USER,
            "--auth=trust",
            "--no-sync",
            "--locale=C",
            "-E",
            "UTF8",
        ]
        subprocess.run(words, check=True, capture_output=True, user=_user())
        server = PostgreSql(Path(folder), free_port())
        try:
            server.start()
            yield server
        finally:
            server.stop()


def _program(name: str) -> Path:
    folder = _programs()
    assert folder is not None
    return folder / name


def _user() -> str | None:
    """Return the user to run as, None for the one of this process."""
    return USER if os.geteuid() == 0 else None
