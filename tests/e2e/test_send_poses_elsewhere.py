"""The guide that sends poses to other systems is followed: their own programs get them from a real service."""

import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import orjson
import pytest

from support.guides import blocks_of, follow
from support.mosquitto import Mosquitto, mosquitto, needs_mosquitto
from support.service import Running
from support.yard import running_yard
from support.zenoh_router import free_port, wait_until

GUIDE, TAG = "send-poses-elsewhere.md", "forklift-7"
pytestmark = needs_mosquitto


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    with mosquitto(tmp_path_factory.mktemp("broker")) as running:
        yield running


@pytest.fixture(scope="module")
def service(broker: Mosquitto, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    settings = f'[mqtt]\nserver = "127.0.0.1"\nport = {broker.port}\ntls = false'
    with running_yard(tmp_path_factory.mktemp("service"), TAG, settings) as running:
        yield running


def followed(heading: str, service: Running, broker: Mosquitto, folder: Path) -> str:
    """Return what the commands below a heading print."""
    blocks = blocks_of(GUIDE, heading)
    named = [
        replace(block, text=block.text.replace("-h broker.example.com -u yard", f"-h 127.0.0.1 -p {broker.port}"))
        for block in blocks
    ]
    return follow(named, folder, service.url)


@pytest.mark.skipif(shutil.which("mosquitto_sub") is None, reason="apt-get install mosquitto-clients")
def test_who_subscribes_gets_the_present_state(service: Running, broker: Mosquitto, tmp_path: Path) -> None:
    said = followed("MQTT and Home Assistant", service, broker, tmp_path)
    assert "dropanchor/default/status online" in said
    (tag,) = (line for line in said.splitlines() if line.startswith(f"dropanchor/default/tag/{TAG} "))
    pose = orjson.loads(tag.split(" ", 1)[1])
    assert pose["tag"] == TAG
    assert ("latitude" in pose) == (pose["state"] == "tracking")


@pytest.mark.skipif(shutil.which("node-red") is None, reason="npm install --global node-red")
def test_node_red_passes_on_the_tags_that_are_tracked(broker: Mosquitto, tmp_path: Path) -> None:
    (flow,) = blocks_of(GUIDE, "Node-RED")
    here = flow.text.replace("broker.example.com", "127.0.0.1").replace("1883", str(broker.port))
    (tmp_path / flow.file).write_text(here)
    with broker.publisher() as client:
        for tag, state in (("a", "lost"), ("b", "tracking")):
            said = {"tag": tag, "state": state}
            client.publish(f"dropanchor/yard/tag/{tag}", orjson.dumps(said), 1, retain=True).wait_for_publish()
    log = tmp_path / "log"
    words = ["node-red", "--userDir", str(tmp_path), "--port", str(free_port()), str(tmp_path / flow.file)]
    with log.open("wb") as output, subprocess.Popen(words, stdout=output) as process:
        try:
            wait_until(lambda: "tag: 'b', state: 'tracking'" in log.read_text())
            assert "tag: 'a'" not in log.read_text()
        finally:
            process.terminate()
