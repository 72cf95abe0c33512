"""Run the service in a process of its own. Its address is read from its log."""

import json
import os
import re
import signal
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from threading import Thread, Timer
from typing import Any

import httpx

from dropanchor_schemas.wire import Frame, HeadingSample, ImuSample, RangeSample
from support.commands import Ended
from support.forks import Forked, can_be_forked, start_forked
from support.kernel_cache import compile_once
from support.patience import PATIENCE_S
from support.zenoh_router import free_endpoint, wait_until

ROOT = Path(__file__).parents[2]
S = 1_000_000_000


@dataclass
class Running:
    """A running service.

    zenoh: its Zenoh endpoint. log: lines on stderr so far. began_s: start of the process, monotonic.
    ca: certificate of the authority that signed its own.
    """

    process: subprocess.Popen[str] | Forked
    zenoh: str
    log: list[str]
    began_s: float
    url: str = ""
    ca: Path | None = None

    def ask(self, method: str, path: str, **options: Any) -> httpx.Response:
        # Without `ca` there is no TLS. Loading the usual authorities would take longer than most answers.
        trusted = False if self.ca is None else ssl.create_default_context(cafile=self.ca)
        with httpx.Client(verify=trusted, trust_env=False) as client:
            return client.request(method, f"{self.url}{path}", **options)

    def get(self, path: str) -> Any:
        return self.ask("GET", path).raise_for_status().json()

    def put(self, path: str, body: object) -> None:
        self.ask("PUT", path, json=body).raise_for_status()

    def metric(self, sample: str) -> float:
        """Return the value of a metric, such as `dropanchor_samples_total{kind="imu"}`; 0 if it is missing."""
        text = self.ask("GET", "/metrics").text
        found = re.search(rf"^{re.escape(sample)} (\S+)$", text, re.MULTILINE)
        return float(found[1]) if found else 0.0

    def stop(self, how: signal.Signals = signal.SIGTERM, timeout_s: float = PATIENCE_S) -> int:
        """Send a signal, wait until the process ends, and return its exit code."""
        self.process.send_signal(how)
        return self.process.wait(timeout_s)


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "dropanchor_service", *arguments]


def ended(*words: str, before: str = "", **variables: str) -> Ended:
    """Run `dropanchor` until it exits, or is killed. variables: more of its environment.

    before: a program that runs in its process before.
    """
    compile_once()
    with TemporaryFile("w+") as output:
        process = start_forked(words, environment(**variables), before, output.fileno())
        late = Timer(PATIENCE_S, process.kill)
        late.start()
        with process.stderr:
            errors = process.stderr.read()
        code = process.wait()
        late.cancel()
        output.seek(0)
        return Ended(code, output.read(), errors)


def with_wrong_clock(words: list[str], ahead_s: float) -> list[str]:
    """Return the command for a Python program so that the clock of its host is ahead by this much."""
    ahead_ns = round(ahead_s * 1e9)
    code = (
        "import runpy, sys, time; now = time.time_ns; "
        f"time.time_ns = lambda: now() + {ahead_ns}; time.time = lambda: time.time_ns() * 1e-9; "
        "runpy.run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)"
    )
    return [words[0], "-c", code, *words[2:]]


def environment(**more: str) -> dict[str, str]:
    """Return this process's environment without its Dropanchor settings, with our packages and these variables."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("DROPANCHOR_")}
    packages = os.pathsep.join(str(ROOT / name) for name in ("schemas", "tag_client", "service", "service/evaluation"))
    return clean | {"PYTHONPATH": packages} | more


@contextmanager
def running_service(
    *arguments: str,
    endpoint: str | None = None,
    ready: bool = True,
    subcommand: str = "serve",
    ca: Path | None = None,
    clock_ahead_s: float = 0.0,
    forked: bool = True,
) -> Iterator[Running]:
    """Run `dropanchor serve` on free ports until the block ends. ready: wait until it reports that it is ready.

    clock_ahead_s: how far the clock of its host is ahead. forked: see `support.forks`.
    """
    compile_once()
    zenoh = endpoint or free_endpoint()
    has_zenoh = subcommand != "api" and not any("--zenoh" in argument for argument in arguments)
    listening = ("--zenoh-listen", zenoh) if has_zenoh else ()
    began_s = time.monotonic()
    words = [subcommand, "--port", "0", *listening, *arguments]
    forked = forked and not clock_ahead_s and can_be_forked()
    process = start_forked(words, environment()) if forked else _started(words, clock_ahead_s)
    running = Running(process, zenoh, [], began_s, ca=ca)
    reader = Thread(target=_read, args=(running,), daemon=True)
    reader.start()
    try:
        wait_until(lambda: running.url or process.poll() is not None, 240.0)  # the first start compiles the engine
        assert running.url, "".join(running.log)
        if ready:
            wait_until(lambda: running.ask("GET", "/api/v1/health/ready").status_code == 200)
        yield running
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        reader.join(PATIENCE_S)
        if process.stderr is not None:
            process.stderr.close()


def _started(words: list[str], clock_ahead_s: float) -> subprocess.Popen[str]:
    program = with_wrong_clock(command(*words), clock_ahead_s) if clock_ahead_s else command(*words)
    return subprocess.Popen(program, stderr=subprocess.PIPE, text=True, env=environment())


@contextmanager
def running_router(*arguments: str) -> Iterator[None]:
    """Run `dropanchor router` until the block ends."""
    words = command("router", *arguments)
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        try:
            assert process.stderr is not None
            assert any("ready at" in line for line in process.stderr)
            yield
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE_S)


def _read(running: Running) -> None:
    assert running.process.stderr is not None
    for line in running.process.stderr:
        running.log.append(line)
        found = re.search(r"(?:ready|standing by) at (https?://\S+?),", line)
        if found:
            running.url = found[1]


def settings_file(folder: Path, tags: Sequence[str], text: str = "") -> Path:
    """Write settings with anchor 7 at the origin, and with tags that start at (10, -20) and head north.

    text: further settings for the top of the file.
    """
    start = "start = { x = 10.0, y = -20.0, heading_rad = 1.5707963 }"
    tables = "\n".join(f"[tags.{json.dumps(tag)}]\n{start}" for tag in tags)
    file = folder / "dropanchor.toml"
    file.write_text(f'{text}\n[[site.anchors]]\nid = "7"\n{tables}\n[paper]\npreset = "tuned"\n')
    return file


def straight_north(count: int, t_ns: int | None = None, speed_mps: float = 1.0) -> Frame:
    """Return noise-free samples of a tag that goes north from (10, -20).

    There are `count` ranges, 0.1 s apart, each with a heading and an IMU sample. The last one is of `t_ns`, or of now.
    """
    end_ns = time.time_ns() if t_ns is None else t_ns
    times = [end_ns - (count - 1 - i) * S // 10 for i in range(count)]
    distances = [(100.0 + (speed_mps * 0.1 * i - 20.0) ** 2) ** 0.5 for i in range(count)]
    return Frame(
        imu=[ImuSample(t, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0), (20.0, 0.0, -40.0)) for t in times],
        ranges=[RangeSample(t, 7, distance, 0.1) for t, distance in zip(times, distances, strict=True)],
        headings=[HeadingSample(t, 1.5707963, 0.05) for t in times],
    )
