"""`dropanchor evaluate` as a user calls it, with a few seeds."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dropanchor_evaluation.commands import evaluate
from dropanchor_evaluation.paper import families, robots, unknown_start
from dropanchor_evaluation.paper.whole import Plan
from dropanchor_evaluation.parallel import Workers
from dropanchor_service.cli import main
from support.commands import environment
from support.patience import PATIENCE_S
from support.recordings import write_square

TINY = Plan(families=2, table1=1, fig4=1, robots=1, draws=2000, anchors=1)
CASES = (
    *(families.Case("L1", name) for name in families.NOISES),
    families.Case("L1", "paper", ("late15",)),
    families.Case("L1", "real", ("nlos10", "drop20")),
)


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluate, "QUICK", TINY)
    monkeypatch.setattr(families, "CASES", CASES)
    monkeypatch.setattr(unknown_start, "CASES", (families.Case("S5", "paper"), families.Case("L1", "paper")))
    monkeypatch.setattr(robots, "MAGNETOMETERS", ("calibrated",))


# All of the families, on two processes, soon after the start.
LONG = """
import sys
from dropanchor_service.cli import main
from dropanchor_evaluation.commands import evaluate
from dropanchor_evaluation.paper.whole import Plan
evaluate.FULL = Plan(table1=1, fig4=1, draws=2000)
sys.exit(main(["evaluate", "paper", "--out", sys.argv[1], "--data", sys.argv[1], "--processes", "2"]))
"""


@pytest.mark.usefixtures("tiny")
def test_the_report_has_every_experiment(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "data" / "square").mkdir(parents=True)
    write_square(tmp_path / "data" / "square", range_std_m=0.05)
    out, page = tmp_path / "out", tmp_path / "paper.md"
    page.write_text("# The paper\n\n<!-- place for paper -->\n")
    options = ["--into", str(page), "--quick", "--out", str(out), "--data", str(tmp_path / "data"), "--processes", "1"]
    assert main(["evaluate", "paper", *options]) == 0
    assert "100%" in capsys.readouterr().err
    found: Any = json.loads((out / "results.json").read_text())
    assert set(found) == {
        *("observability", "fig3", "error_propagation", "fig4", "table1"),
        *("families", "unknown_start", "robots", "recordings"),
    }
    assert found["families"]["rows"]["L1-paper"]["vanilla EKF, tuned"]["median"] > 0
    assert found["recordings"]["square"]["A"]["Algorithm 1, tuned"]["rmse"] < 2.0
    assert "### Table I" in page.read_text()
    assert "Real recordings" not in page.read_text()
    report = (out / "report.html").read_text()
    assert "seeds 1000 to 1007" in report
    assert "2.81" in report
    for picture in ("families_paper", "perturbations", "robots_triangle", "robots_TUM"):
        assert f'src="{picture}.png"' in report
        assert (out / f"{picture}.png").read_bytes().startswith(b"\x89PNG")


def test_the_same_seeds_give_the_same_numbers_in_one_process_or_two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(families, "CASES", (CASES[-1], replace(CASES[-1], family="S5")))
    found = []
    for processes in (1, 2):
        with Workers(processes) as workers:
            tasks = list(workers.map(families.work, families.tasks(range(1))))
        found.append([[{name: repr(score.runs) for name, score in task.items()}] for task in tasks])
    one, two = found
    assert one == two
    assert one[0] != one[1]


def test_the_engines_are_compared_on_recordings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "square").mkdir()
    write_square(tmp_path / "square", range_std_m=0.05)
    page = tmp_path / "recordings.md"
    page.write_text("# Recordings\n\n<!-- place for recordings -->\n")
    options = ["--data", str(tmp_path), "--processes", "1", "--into", str(page)]
    assert main(["evaluate", "recordings", *options]) == 0
    printed = capsys.readouterr().out
    assert "| square | A |" in printed
    assert "development set" in printed
    assert "| square | A |" in page.read_text()


@pytest.mark.parametrize("what", ["paper", "recordings", "product"])
def test_a_page_without_a_place_is_said_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    page = tmp_path / "page.md"
    page.write_text("text\n")
    assert main(["evaluate", what, "--data", str(tmp_path), "--into", str(page)]) == 2
    printed = capsys.readouterr().err
    assert f"page.md has no place for {what}" in printed
    assert "%" not in printed


def test_a_folder_without_recordings_is_an_error_that_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "recordings", "--data", str(tmp_path / "none"), "--processes", "1"]) == 2
    assert "none holds no recording" in capsys.readouterr().err


def test_a_report_folder_that_is_not_writable_is_an_error_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert main(["evaluate", "paper", "--out", str(tmp_path / "file"), "--processes", "1"]) == 2
    assert "file" in capsys.readouterr().err


def test_ctrl_c_ends_the_command_and_its_processes(tmp_path: Path) -> None:
    command = [sys.executable, "-c", LONG, str(tmp_path)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, env=environment(), start_new_session=True)
    assert process.stderr is not None
    output = b""
    while b"families" not in output:  # the worker processes now run
        read = os.read(process.stderr.fileno(), 4096)
        assert read, output
        output += read
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGINT)  # to the whole group, like a terminal
    _, rest = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert rest.endswith(b"stopped\n")
    assert b"Traceback" not in rest
    assert _all_ended(process.pid, within_s=PATIENCE_S)


def _all_ended(group: int, within_s: float) -> bool:
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False
