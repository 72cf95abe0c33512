"""The service as its users run it: a process of its own."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen


@contextmanager
def running_service(port: int, zenoh_endpoint: str, config: Path, timeout_s: float = 60) -> Iterator[str]:
    """The address of its page, once it answers. At the end it is stopped as by Ctrl-C."""
    command = [sys.executable, "-m", "dropanchor_service", "serve", "--config", str(config)]
    options = ["--port", str(port), "--zenoh-listen", zenoh_endpoint]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([*command, *options], env=environment)
    try:
        url = f"http://127.0.0.1:{port}/"
        _wait_until_it_answers(process, f"{url}api/v1/site", timeout_s)
        yield url
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=10)
        finally:
            process.kill()
            process.wait()


def _wait_until_it_answers(process: subprocess.Popen[bytes], url: str, timeout_s: float) -> None:
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        assert process.poll() is None, f"the service ended with {process.returncode}"
        try:
            with urlopen(url, timeout=5):
                return
        except URLError:
            time.sleep(0.1)
    raise AssertionError(f"the service did not answer within {timeout_s} s")
