"""Run `dropanchor-tag mqtt`, and publish to its broker."""

import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from paho.mqtt.client import Client

from support.commands import start_python
from support.patience import PATIENCE_S


@contextmanager
def bridge(endpoint: str, broker: str, *arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """Run `dropanchor-tag mqtt` until the block ends."""
    process = start_python("-m", "dropanchor_tag_client", "mqtt", broker, "--connect", endpoint, *arguments)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)


def wait_for_line(process: "subprocess.Popen[str]", text: str) -> str:
    """Read what the bridge says until this text comes, and return the line."""
    assert process.stderr is not None
    for line in process.stderr:
        if text in line:
            return line
    raise AssertionError(f"the bridge ended without saying {text!r}")


def publish(client: Client, topic: str, payload: object) -> None:
    body = payload if isinstance(payload, bytes) else json.dumps(payload)
    client.publish(topic, body, qos=1).wait_for_publish(10)


def field_or_skip(name: str) -> Path:
    """Return a file of what devices publish: in `../shared` beside the checkout, or in the folder DROPANCHOR_SHARED."""
    shared = Path(os.environ.get("DROPANCHOR_SHARED", Path(__file__).parents[3] / "shared"))
    file = shared / "field" / "devices" / "mqtt" / name
    if not file.is_file():
        pytest.skip(f"{file} does not exist: DROPANCHOR_SHARED names the folder that has field/devices")
    return file
