"""Run Debian's PgBouncer on loopback before a database."""

import os
import pwd
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg
import pytest

from support.postgresql import Postgresql
from support.zenoh_router import free_port, wait_until

_PROGRAM = shutil.which("pgbouncer") or shutil.which("pgbouncer", path="/usr/sbin")
needs_pgbouncer = pytest.mark.skipif(_PROGRAM is None, reason="PgBouncer is not installed: apt-get install pgbouncer")


@contextmanager
def running_pgbouncer(server: Postgresql, folder: Path, pool_mode: str) -> Iterator[int]:
    """Provide the port of a pooler in this mode. folder: one that its user may read."""
    assert _PROGRAM is not None
    port, config = free_port(), folder / f"{pool_mode}.ini"
    (folder / "users").write_text('"dropanchor" ""\n')
    config.write_text(
        f"[databases]\n* = host={server.host} port={server.port}\n[pgbouncer]\nlisten_addr = 127.0.0.1\n"
        f"listen_port = {port}\npool_mode = {pool_mode}\nauth_type = trust\nunix_socket_dir =\n"
        f"ignore_startup_parameters = extra_float_digits\nauth_file = {folder}/users\n"
    )
    user = pwd.getpwnam("postgres").pw_uid if os.geteuid() == 0 else None
    with subprocess.Popen([_PROGRAM, "-q", str(config)], user=user) as process:
        try:
            wait_until(lambda: _answers(f"postgresql://dropanchor@127.0.0.1:{port}/postgres"))
            yield port
        finally:
            process.kill()


def _answers(url: str) -> bool:
    try:
        with psycopg.connect(url):
            return True
    except psycopg.OperationalError:
        return False
