"""A Foxglove viewer shows what a real service knows of a simulated tag."""

import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import cos, hypot
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from dropanchor_service.cli import main
from support.foxglove_viewer import viewer_at
from support.live_tags import LiveTags, is_current
from support.patience import PATIENCE_S
from support.service import Running, command, environment, running_service
from support.zenoh_router import free_port, wait_until

TAG = "sim-1"


@contextmanager
def running_bridge(*arguments: str) -> Iterator[tuple[str, list[str]]]:
    """Run `dropanchor foxglove` until the block ends. Yield the address for viewers and the lines on stderr so far."""
    words = command("foxglove", "--port", "0", *arguments)
    said: list[str] = []
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        assert process.stderr is not None
        reader = Thread(target=said.extend, args=(process.stderr,))
        reader.start()
        try:
            wait_until(lambda: _address(said) or process.poll() is not None)
            yield _address(said), said
        finally:
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0, said
            reader.join()


def _address(said: list[str]) -> str:
    return next((found[1] for line in said if (found := re.search(r"ready at (ws://\S+)", line))), "")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    config = _settings(tmp_path_factory.mktemp("site"))
    with running_service("--config", str(config)) as running, LiveTags(running.zenoh, tags=1, seed=1):
        wait_until(lambda: is_current(running, 1))
        yield running


def _settings(folder: Path) -> Path:
    file = LiveTags("", tags=1, seed=1).write_settings(folder, "[site.georeference]", "lat = 48.0", "lon = 11.0")
    file.write_text(file.read_text().replace(f'[tags."{TAG}"]', f'[tags."{TAG}"]\nheight_m = 0.5'))
    return file


def test_a_viewer_sees_the_tag_move_with_its_ellipse_its_state_and_the_anchor(service: Running) -> None:
    with running_bridge("--url", service.url) as (address, _), viewer_at(address) as viewer:
        topics = {"/scene", "/tf", "/locations", f"/tag/{TAG}/pose", f"/tag/{TAG}/estimate"}
        viewer.receive_until(lambda: topics <= viewer.messages.keys() and _path_length(viewer.messages) > 1.0)
        viewer.receive_until(lambda: _entities(viewer.messages).keys() == {"anchor/1", f"tag/{TAG}"})
        assert viewer.schemas["/scene"] == "foxglove.SceneUpdate"
        seen = viewer.messages

        pose = seen[f"/tag/{TAG}/pose"][-1]
        stored = service.get(f"/api/v1/tags/{TAG}/pose?at={pose.timestamp.ToNanoseconds()}")
        assert (pose.frame_id, pose.pose.position.z) == ("site", 0.5)
        assert hypot(pose.pose.position.x - stored["x"], pose.pose.position.y - stored["y"]) < 0.05
        assert abs(2 * pose.pose.orientation.w**2 - 1 - cos(stored["heading_rad"])) < 0.05

        drawn = _entities(seen)[f"tag/{TAG}"]
        assert drawn.texts[0].text == f"{TAG}: {seen[f'/tag/{TAG}/estimate'][-1]['state']}"
        half_axes = [hypot(point.x, point.y) for point in drawn.lines[-1].points]
        estimate = service.get(f"/api/v1/tags/{TAG}/pose")["ellipse_95"]
        assert max(half_axes) == pytest.approx(estimate["semi_major_m"], rel=0.5)

        viewer.receive_until(lambda: _frames(seen).keys() == {"anchor/1", f"tag/{TAG}"})
        frames = _frames(seen)
        assert frames[f"tag/{TAG}"].parent_frame_id == "site"
        assert seen["/locations"][-1].fixes[0].latitude == pytest.approx(48.0, abs=0.01)


def _frames(messages: dict[str, list[Any]]) -> dict[str, Any]:
    return {one.child_frame_id: one for update in messages["/tf"] for one in update.transforms}


def _entities(messages: dict[str, list[Any]]) -> dict[str, Any]:
    return {entity.id: entity for update in messages.get("/scene", []) for entity in update.entities}


def _path_length(messages: dict[str, list[Any]]) -> float:
    places = [message.pose.position for message in messages.get(f"/tag/{TAG}/pose", [])]
    return sum(hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(places))


def test_only_the_named_tags_are_shown(service: Running) -> None:
    with running_bridge("nobody", "--url", service.url) as (address, _), viewer_at(address) as viewer:
        viewer.receive_until(lambda: len(viewer.messages.get("/scene", [])) >= 2)
        viewer.receive_until(lambda: "anchor/1" in _entities(viewer.messages))
        assert _entities(viewer.messages).keys() == {"anchor/1"}


def test_a_viewer_stays_connected_while_the_service_is_away(tmp_path: Path) -> None:
    config, port = str(_settings(tmp_path)), str(free_port())
    with running_service("--config", config, "--port", port) as service:
        url = service.url
        bridge = running_bridge("--url", url)
        address, said = bridge.__enter__()
    try:
        with viewer_at(address) as viewer:
            wait_until(lambda: any("Still trying" in line for line in said))
            assert viewer.messages == {}
            with running_service("--config", config, "--port", port):
                viewer.receive_until(lambda: "/scene" in viewer.messages)
                wait_until(lambda: any("answers again" in line for line in said))
                assert sum("Still trying" in line for line in said) == 1
    finally:
        bridge.__exit__(None, None, None)


def test_what_cannot_start_says_why(service: Running, capsys: pytest.CaptureFixture[str]) -> None:
    taken = service.url.rpartition(":")[2]
    assert main(["foxglove", "--url", f"http://127.0.0.1:{free_port()}"]) == 2
    assert main(["foxglove", "--url", service.url, "--port", taken]) == 2
    assert main(["foxglove", "--url", service.url, "--host", "0.0.0.0"]) == 2
    away, in_use, exposed = capsys.readouterr().err.splitlines()
    assert "does not answer" in away
    assert "in use" in in_use
    assert "--port" in in_use
    assert "--insecure" in exposed
