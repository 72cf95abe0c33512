"""Measure how old the pose of a tag becomes while its neighbour sends 20,000 frames at once."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Event, Thread

import httpx
import pytest

from benchmarks import report
from benchmarks.programs import running
from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, HeadingSample, ImuSample, RangeSample, encode_packed
from support.service import Running, running_service, settings_file
from support.zenoh_router import connected_session, wait_until

FRAMES = 20_000
BEFORE_S, AFTER_S, SETTLE_S = 3.0, 9.0, 3.0
PERIOD_S = 0.05  # between two messages of the neighbour
NEIGHBOUR, BURSTING = "neighbour", "bursting"
LOADS = (0, 4, 10)  # busy processes beside the service
HEAD = (
    "| boot ids | busy processes | oldest pose of the neighbour before s | during s | its messages lost "
    "| used of the burst so far | shed of the burst |\n" + "|---" * 7 + "|"
)

pytestmark = pytest.mark.benchmark


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep `count` processes computing until the block ends."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


@contextmanager
def neighbour(endpoint: str) -> Iterator[list[int]]:
    """Send messages of the neighbour until the block ends. Yield the times of what was sent."""
    sent: list[int] = []
    stop = Event()

    def send() -> None:
        next_s = time.monotonic()
        with connected_session(endpoint) as session:
            while not stop.wait(max(0.0, next_s - time.monotonic())):
                next_s += PERIOD_S
                t_ns = time.time_ns()
                frame = Frame(
                    imu=[ImuSample(t_ns, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0), (20.0, 0.0, -40.0))],
                    ranges=[RangeSample(t_ns, 7, 22.36 + 0.01 * (len(sent) % 7), 0.1)],
                    headings=[HeadingSample(t_ns, 1.5707963, 0.05)],
                    sequence=len(sent),
                    boot_id=77,
                )
                session.put(samples_key("default", NEIGHBOUR), encode_packed(frame), encoding=ENCODING_PACKED)
                sent.append(t_ns)

    thread = Thread(target=send)
    thread.start()
    try:
        yield sent
    finally:
        stop.set()
        thread.join()


def oldest_s(service: Running, seconds: float) -> float:
    """Ask for the pose of the neighbour again and again. Return how old the oldest one was."""
    oldest, end_s = 0.0, time.monotonic() + seconds
    with httpx.Client(base_url=service.url, timeout=30.0, trust_env=False) as client:
        while time.monotonic() < end_s:
            asked_ns = time.time_ns()
            pose = client.get(f"/api/v1/tags/{NEIGHBOUR}/pose").json()
            oldest = max(oldest, (asked_ns - pose["t_ns"]) * 1e-9)
            time.sleep(0.02)
    return oldest


def used(service: Running, tag: str) -> tuple[int, int]:
    """Return how many messages of a tag were used, and how many were shed."""
    about = service.get(f"/api/v1/tags/{tag}")
    return about["messages"], about["rejected"].get("shed", 0)


def measure(folder: Path, boots: str, load: int) -> str:
    with ExitStack() as stack:
        file = settings_file(folder, [NEIGHBOUR, BURSTING])
        service = stack.enter_context(running_service("--config", str(file)))
        key = samples_key("default", BURSTING)
        sender = stack.enter_context(running("burst", service.zenoh, key, FRAMES, boots))
        sent = stack.enter_context(neighbour(service.zenoh))
        stack.enter_context(busy(load))
        wait_until(lambda: service.ask("GET", f"/api/v1/tags/{NEIGHBOUR}/pose").status_code == 200)
        before = oldest_s(service, BEFORE_S)
        sender.send_line("go")
        oldest = oldest_s(service, AFTER_S)
        count = len(sent)
        oldest_s(service, SETTLE_S)
        lost = max(0, count - used(service, NEIGHBOUR)[0])
        of_burst, shed = used(service, BURSTING)
    return f"| {boots} | {load} | {before:.2f} | {oldest:.2f} | {lost} | {of_burst:,} | {shed:,} |"


def test_a_burst_beside_a_neighbour(tmp_path: Path) -> None:
    rows = [measure(tmp_path, boots, load) for boots in ("one", "new") for load in LOADS]
    report.record("bursts", "\n".join([HEAD, *rows]))
