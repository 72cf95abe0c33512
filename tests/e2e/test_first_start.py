"""The first start compiles the estimator. It reports its progress, serves the page meanwhile and can be interrupted."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import httpx
import pytest

from dropanchor_tag_client import TagClient
from support.patience import PATIENCE_S
from support.service import command, environment
from support.zenoh_router import free_endpoint, free_port, wait_until

COMPILING_S = 600.0  # at most, on a busy machine


@pytest.mark.parametrize(("subcommand", "how"), [("serve", signal.SIGTERM), ("demo", signal.SIGINT)])
def test_a_signal_ends_a_first_start_while_it_compiles(tmp_path: Path, subcommand: str, how: signal.Signals) -> None:
    arguments = command(subcommand, "--port", "0", "--zenoh-listen", free_endpoint())
    empty = environment(NUMBA_CACHE_DIR=str(tmp_path))
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, env=empty) as process:
        try:
            assert process.stderr is not None
            assert "once after an update" in process.stderr.readline()
            wait_until(lambda: any(tmp_path.rglob("*.nbi")), COMPILING_S)  # it compiles
            process.send_signal(how)
            assert process.wait(PATIENCE_S) == 0
            assert [line for line in process.stderr if "s so far" not in line] == []
        finally:
            process.kill()


def test_a_first_start_serves_the_page_at_once_and_loses_no_sample(tmp_path: Path) -> None:
    cache, but_the_decoder = tmp_path / "cache", shutil.ignore_patterns("kernels_*")  # whose compilation takes seconds
    shutil.copytree(os.environ["NUMBA_CACHE_DIR"], cache, ignore=but_the_decoder)
    url, zenoh = f"http://127.0.0.1:{free_port()}", free_endpoint()
    arguments = command("serve", "--engine", "paper", "--port", url.rpartition(":")[2], "--zenoh-listen", zenoh)

    def status(path: str) -> int:
        try:
            return httpx.get(url + path, trust_env=False, verify=False).status_code
        except httpx.TransportError:
            return 0

    with subprocess.Popen(arguments, stderr=subprocess.DEVNULL, env=environment(NUMBA_CACHE_DIR=str(cache))) as process:
        try:
            wait_until(lambda: status("/") == 200)
            wait_until(lambda: "so far" in httpx.get(f"{url}/api/v1/health/ready", trust_env=False, verify=False).text)
            assert status("/api/v1/poses") == 503
            with TagClient("cart", connect=zenoh, spool=tmp_path / "spool") as tag:
                for number in range(20):
                    tag.publish_range(1, 5.0 + 0.01 * number)
                assert status("/api/v1/health/ready") == 503
                wait_until(lambda: status("/api/v1/health/ready") == 200, COMPILING_S)
                wait_until(lambda: status("/api/v1/tags/cart") == 200)
            tag_status = f"{url}/api/v1/tags/cart"
            wait_until(lambda: httpx.get(tag_status, trust_env=False, verify=False).json()["samples"] == {"range": 20})
        finally:
            process.terminate()
            assert process.wait(PATIENCE_S) == 0
