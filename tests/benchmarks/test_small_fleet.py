"""Measure what a service costs whose tags are few: without any, and with five in each of ten sites.

In the same seconds, a program gets the same messages and drops them: that much costs Zenoh, whatever the service does.
"""

import json
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks import proc, report
from benchmarks.motion import ANCHOR, tracks
from benchmarks.programs import generator, running
from benchmarks.service import counters, lost
from benchmarks.step import when_quiet
from support.commands import environment
from support.service import running_service
from support.zenoh_router import free_endpoint

SITES, TAGS = [f"site-{number}" for number in range(10)], 50
SETTLE_S, IDLE_S, MOVING_S = 5.0, 20.0, 30.0
FLOOR = """
import resource
from pathlib import Path
def shown(what):
    pages = Path("/proc/self/statm").read_text().split()
    resident, of_files = (int(count) * resource.getpagesize() / 1e6 for count in pages[1:3])
    print(what, round(resident), round(resident - of_files), sep=";")
shown("Python")
import numpy, zenoh
shown("NumPy and Zenoh")
import fastapi, uvicorn
shown("FastAPI and uvicorn")
import numba
shown("numba with LLVM")
import dropanchor_service.service
shown("the modules of the service")
from dropanchor_service.engines.compiled import compiled_engine
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.settings.model import Settings
compiled_engine(Settings(), CompilationProgress())
shown("the kernels")
from dropanchor_service.runtime.memory import give_back_files
give_back_files()
shown("file pages given back")
"""

pytestmark = pytest.mark.benchmark


def settings_file(folder: Path) -> Path:
    """Write settings of the sites, with the start of every tag."""
    starts = [track.start for track in tracks(1.0)]
    text = ""
    for index, site in enumerate(SITES):
        text += f'[[sites.{site}.site.anchors]]\nid = "{ANCHOR}"\n'
        for tag in range(index, TAGS, len(SITES)):
            x, y, heading = starts[tag % len(starts)]
            text += f"[sites.{site}.tags.sim-{tag}.start]\nx = {x!r}\ny = {y!r}\nheading_rad = {heading!r}\n"
    file = folder / "sites.toml"
    file.write_text(text)
    return file


def test_the_cost_of_ten_sites_with_five_tags_each(tmp_path: Path) -> None:
    with ExitStack() as stack:
        service = stack.enter_context(
            running_service("--config", str(settings_file(tmp_path)), "--data-dir", str(tmp_path))
        )
        pid = service.process.pid
        time.sleep(SETTLE_S)
        idle_mb, began_s = proc.resident_bytes(pid) / 1e6, proc.thread_s(pid)
        time.sleep(IDLE_S)
        idle = (proc.thread_s(pid) - began_s) / IDLE_S
        bare = stack.enter_context(running("receiver", "own", endpoint := free_endpoint())).process.pid
        fleets = [generator(where, TAGS, SETTLE_S + MOVING_S, sites=SITES) for where in (service.zenoh, endpoint)]
        for fleet in fleets:
            stack.callback(fleet.end)
        before = counters(service)
        for fleet in fleets:
            fleet.send_line(time.time_ns() + 300_000_000)
        time.sleep(SETTLE_S)
        written, began_s = proc.written_bytes(pid), time.monotonic()
        cpu, bare_cpu = cores_in_use(pid, bare)
        worn = (proc.written_bytes(pid) - written) / (time.monotonic() - began_s)
        moving_mb = proc.resident_bytes(pid) / 1e6
        sent, _ = (json.loads(fleet.request("end")) for fleet in fleets)
        missing = lost(sent["messages"], before, when_quiet(lambda: counters(service)))
    report.record(
        "small",
        f"Without tags: {idle * 100:.2f} % of a core, {idle_mb:.0f} MB resident. {TAGS} tags in {len(SITES)} sites: "
        f"{cpu:.3f} of a core, {moving_mb:.0f} MB, {worn / 1e3:.0f} kB/s written, {missing} samples lost. A program "
        f"that receives the same messages and drops them: {bare_cpu:.3f} of a core.\n\n" + floor(),
    )
    assert missing == 0


def cores_in_use(*processes: int) -> list[float]:
    """Return the share of a core that each process takes while the tags move."""
    spent_s, began_s = MOVING_S - 2.0, [proc.thread_s(process) for process in processes]
    time.sleep(spent_s)
    return [(proc.thread_s(process) - began) / spent_s for process, began in zip(processes, began_s, strict=True)]


def floor() -> str:
    """Return what each part of a process adds to its memory, as a table."""
    run = subprocess.run([sys.executable, "-c", FLOOR], env=environment(), capture_output=True, text=True, check=True)
    rows = [f"| {' | '.join(line.split(';'))} |" for line in run.stdout.splitlines()]
    return "\n".join(["| a process with, added up | MB resident | of them not in files |", "|---|---|---|", *rows])
