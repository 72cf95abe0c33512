"""Measure how long a question about one minute takes that is twenty hours old, in a full black box of fifty tags."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import pytest

from benchmarks import report
from benchmarks.proc import children_cpu_s
from dropanchor_service.blackbox.opened import box_folder
from dropanchor_service.blackbox.pieces import SUFFIX, pieces_in
from support.scripted_past import S, Script, write_past
from support.service import Running, running_service

pytestmark = pytest.mark.benchmark
TAGS, SEED, WRITTEN_S, OLD_NS = 50, 41, 150.0, 20 * 3600 * S
ASKED_S, BEFORE_S = 125, 30
QUESTIONS = 5
OTHER_SESSION = "0" * 16
ROOM = "[blackbox]\nmax_mib = 30000\n"


def fill(folder: Path) -> int:
    """Link a written piece under the names of all minutes since. Return how many pieces there are."""
    pieces = pieces_in(folder)
    for from_ns in range(pieces[-1].from_ns + 60 * S, time.time_ns(), 60 * S):
        os.link(pieces[1].path, folder / f"{from_ns:019d}-{OTHER_SESSION}{SUFFIX}")
    return len(pieces_in(folder))


def measured(service: Running, ask: Callable[[int], str]) -> str:
    """Return the cells of a kind of question. ask: asks about a tag and returns what was asked."""
    seconds, before = list[float](), children_cpu_s(service.process.pid)
    for tag in range(1, QUESTIONS + 1):
        began = time.monotonic()
        what = ask(tag)
        seconds.append(time.monotonic() - began)
    cpu = (children_cpu_s(service.process.pid) - before) / QUESTIONS
    return f"| {what} | {median(seconds):.1f} / {max(seconds):.1f} | {cpu:.1f} | {os.getloadavg()[0]:.1f} |"


def test_questions_about_a_minute_that_is_twenty_hours_old(tmp_path: Path) -> None:
    t0_ns = (time.time_ns() - OLD_NS) // S * S
    config = write_past(tmp_path, TAGS, SEED, t0_ns, WRITTEN_S, Script())
    config.write_text(config.read_text() + ROOM)
    data = tmp_path / "data"
    count, at_ns = fill(box_folder(data, None)), t0_ns + ASKED_S * S
    with running_service("--config", str(config), "--data-dir", str(data)) as service:

        def explain(tag: int) -> str:
            service.get(f"/api/v1/tags/sim-{tag}/explain?at={at_ns}&last=300")
            return "explain a pose"

        def what_if(tag: int) -> str:
            what = {"from_ns": at_ns - BEFORE_S * S, "to_ns": at_ns, "settings": {"motion": "vehicle"}}
            service.ask("POST", f"/api/v1/tags/sim-{tag}/what-if", json=what).raise_for_status()
            return "half a minute with another setting"

        rows = [measured(service, ask) for ask in (explain, what_if)]
    report.record(
        "blackbox",
        f"Questions about a moment of 20 h ago, of one of {TAGS} tags, in a black box of {count} pieces of a minute: "
        "those that are read are of that time, the others have the same size.\n\n"
        "| question | s, median / longest | CPU-s | load |\n|---|---|---|---|\n" + "\n".join(rows),
    )
