"""A running service explains a moment that is past as it explained it then, also after it was killed."""

import csv
import signal
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from dropanchor_service.cli import main
from support.live_tags import LiveTags, is_current
from support.patience import PATIENCE_S
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

S = 1_000_000_000
TAGS, SEED, TAG = 2, 5, "sim-2"
ASKED = f"/api/v1/tags/{TAG}"
THEN = ("t_ns", "x", "y", "heading_rad", "speed_mps", "state", "covariance", "hypotheses")


def explained(service: Running, at_ns: int) -> dict[str, Any]:
    found: dict[str, Any] = run_again(service, "GET", f"explain?at={at_ns}&last=10")
    return found


def run_again(service: Running, method: str, path: str, **options: Any) -> Any:
    """Return the answer of a run of the past. A busy machine may need longer for one than it may take."""
    answers: list[httpx.Response] = []

    def is_answered() -> bool:
        answers.append(service.ask(method, f"{ASKED}/{path}", timeout=PATIENCE_S, **options))
        return answers[-1].status_code != 503

    wait_until(is_answered, 4 * PATIENCE_S)
    return answers[-1].raise_for_status().json()


def is_tracked(track: dict[str, Any], from_ns: int) -> bool:
    """Return whether the tag knew where it was for more than a second from this time on."""
    states = [state for t_ns, state in zip(track["t_ns"], track["state"], strict=True) if 0 <= t_ns - from_ns < 1.5 * S]
    return len(states) > 5 and {*states} == {"tracking"}


def tracked(track: dict[str, Any], from_ns: int, to_ns: int) -> list[int]:
    """Return the times between these, without the last second, from which on the tag was tracked for a while."""
    return [t_ns for t_ns in track["t_ns"] if from_ns < t_ns < to_ns - S and is_tracked(track, t_ns)]


def explained_once_tracked(service: Running, began_ns: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a live explanation before which the tag was tracked for a while, and one of two seconds later."""
    found: list[tuple[dict[str, Any], dict[str, Any]]] = []

    def was_tracked() -> bool:
        live = service.get(f"{ASKED}/explain?last=10")
        at_ns = live["pose"]["t_ns"]
        wait_until(lambda: service.get(f"{ASKED}/pose")["t_ns"] > at_ns + 2 * S)
        found.append((live, explained(service, at_ns + 2 * S)))
        return bool(tracked(found[-1][1]["past"]["track"], began_ns, at_ns))

    wait_until(was_tracked, 4 * PATIENCE_S)
    return found[-1]


def test_a_moment_before_a_kill_is_explained_as_it_was_then_and_its_samples_and_a_what_if_are_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, TAGS, SEED)
    config = tags.write_settings(tmp_path)
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", endpoint)
    with router_process(endpoint), tags:
        with running_service(*options) as service:
            wait_until(lambda: is_current(service, TAGS))
            began_ns = time.time_ns()
            wait_until(lambda: service.get(f"{ASKED}/pose")["t_ns"] > began_ns + 8 * S)
            live, before = explained_once_tracked(service, began_ns)
            at_ns = live["pose"]["t_ns"]
            assert before["pose"]["t_ns"] > at_ns
            service.stop(signal.SIGKILL)
        with running_service(*options) as service:
            wait_until(lambda: is_current(service, TAGS))
            again = explained(service, at_ns + 2 * S)
            assert {name: again["pose"][name] for name in THEN} == {name: before["pose"][name] for name in THEN}
            track = again["past"]["track"]
            place = track["t_ns"].index(at_ns)
            assert [track[name][place] for name in ("x", "y")] == [live["pose"][name] for name in ("x", "y")]
            assert live["pose"]["state"] in (track["state"][place], "coasting")  # the answer came when it was older
            period = {"from_ns": tracked(track, began_ns, at_ns)[0] + S, "to_ns": at_ns}
            what = period | {"settings": {"motion": "carried"}}
            run = run_again(service, "POST", "what-if", json=what)
            assert run["began_at_pose"]
            place = track["t_ns"].index(run["as_was"]["t_ns"][-1])
            assert run["as_was"]["x"][-1] == track["x"][place] != run["what_if"]["x"][-1]
            assert service.get(f"{ASKED}/settings")["motion"] == "auto"
            query = f"from={began_ns}&to={at_ns}"
            table = [*csv.DictReader(service.ask("GET", f"{ASKED}/samples?{query}&format=csv").text.splitlines())]
            assert {row["kind"] for row in table} == {"imu", "range"}
            (tmp_path / "sent.mcap").write_bytes(service.ask("GET", f"{ASKED}/samples?{query}&anonymous=true").content)
            for path, status in (("explain?at=1700000000000000000", 404), (f"samples?from=0&to={at_ns}", 422)):
                assert service.ask("GET", f"{ASKED}/{path}").status_code == status
    capsys.readouterr()
    assert main(["replay", str(tmp_path / "sent.mcap"), "--out", str(tmp_path / "poses.csv")]) == 0
    assert "tag-1: " in capsys.readouterr().out
