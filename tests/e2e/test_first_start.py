"""The first start compiles the estimator. It reports its progress and can be interrupted."""

import signal
import subprocess
from pathlib import Path

import pytest

from support.service import command, environment
from support.zenoh_router import free_endpoint


@pytest.mark.parametrize(("subcommand", "how"), [("serve", signal.SIGTERM), ("demo", signal.SIGINT)])
def test_a_signal_ends_a_first_start_while_it_compiles(tmp_path: Path, subcommand: str, how: signal.Signals) -> None:
    arguments = command(subcommand, "--port", "0", "--zenoh-listen", free_endpoint())
    empty = environment(NUMBA_CACHE_DIR=str(tmp_path))
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, env=empty) as process:
        try:
            assert process.stderr is not None
            log: list[str] = []
            while "s so far" not in "".join(log[-1:]):
                log.append(process.stderr.readline())
                assert log[-1], log
            assert "once after an update" in log[0]
            process.send_signal(how)
            assert process.wait(30.0) == 0
            assert process.stderr.read() == ""
        finally:
            process.kill()
