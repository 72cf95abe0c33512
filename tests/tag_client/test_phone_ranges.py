"""The parts of apps that range with a phone's own radio, and the guide to them."""

import json
import math
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import Frame
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator
from dropanchor_tag_client.sources.bridge.measurement import Measurement
from dropanchor_tag_client.sources.bridge.rules import rules_of
from support.api import make_api_bench
from support.http_server import running_server

ROOT = Path(__file__).parents[2]
PARTS, PLATFORM = ROOT / "tag_client" / "phones", Path(__file__).parent / "phones"
GUIDE = (ROOT / "service" / "docs" / "how-to" / "range-with-a-phone.md").read_text()
MESSAGE, RULES = (re.search(f"```{begin}(.*?)```", GUIDE, re.DOTALL)[1] for begin in ("json\n", r"\n(?=\[\[rule)"))  # type: ignore[index]


@pytest.mark.parametrize("bearings", [slice(None), slice(0)], ids=["anchor", "tag"])
def test_the_message_of_the_guide_is_the_same_over_http_and_by_its_rules_for_mqtt(
    bearings: slice, tmp_path: Path
) -> None:
    message = json.loads(MESSAGE)
    message["bearing"] = message["bearing"][bearings]
    frame = decode_json(json.dumps(message).encode())
    assert isinstance(frame, Frame)
    assert (len(frame.ranges), len(frame.bearings)) == (1, len(message["bearing"]))
    (tmp_path / "phones.toml").write_text(RULES)
    found = [one for rule in rules_of(tmp_path / "phones.toml") for one in rule.parse("phones/anna", message, 0)]
    kinds = [("range", one) for one in message["range"]] + [("bearing", one) for one in message["bearing"]]
    assert found == [Measurement("anna", kind, one) for kind, one in kinds]


@pytest.mark.skipif(shutil.which("kotlinc") is None, reason="Kotlin is not installed: apt-get install kotlin")
def test_an_android_phone_posts_each_kind_of_range_and_as_an_anchor_azimuths(tmp_path: Path) -> None:
    """The part is compiled with what stands for the platform, whose clock is 60 s after its start."""
    sources = map(str, [PARTS / "Ranges.kt", *PLATFORM.glob("*.kt")])
    done = subprocess.run(["kotlinc", *sources, "-d", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    keys, bench = ApiKeys(tmp_path), make_api_bench()
    secret = keys.add_for_tag("anna's phone", "anna")
    began_ns = time.time_ns()
    with running_server(bench.app(authenticator=Authenticator({SOURCE: keys})), bench.stopping) as port:
        words = ["kotlin", "-classpath", str(tmp_path), "MainKt", f"http://127.0.0.1:{port}", secret]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    ended_ns = time.time_ns()
    assert (done.returncode, done.stdout.split()) == (0, ["202"] * 4), done.stderr
    assert {tag for tag, _, _ in bench.received} == {"anna"}
    frames = [decode_json(payload) for _, payload, _ in bench.received]
    assert all(isinstance(frame, Frame) for frame in frames)
    samples = [(frame.ranges[0], frame.bearings) for frame in frames if isinstance(frame, Frame)]
    assert [one.range_m for one, _ in samples] == [3.5, 3.5, 4.5, 5.5]
    assert [[bearing.bearing_rad for bearing in bearings] for _, bearings in samples] == [
        [pytest.approx(-math.radians(30))],
        [],
        [],
        [],
    ]
    sent_ns = [one.t_ns + age_s * 10**9 for (one, _), age_s in zip(samples, (1, 1, 2, 3), strict=True)]
    assert all(began_ns - 10**6 <= t_ns <= ended_ns for t_ns in sent_ns)


def test_an_iphone_sends_no_field_that_the_schema_does_not_know() -> None:
    """There is no compiler of Swift to try more with."""
    swift = (PARTS / "Ranges.swift").read_text()
    fields = {
        name: set(re.findall(r"let (\w+):", body))
        for name, body in re.findall(r"struct (\w+): Encodable \{(.*?)\n\}", swift, re.DOTALL)
    }
    message = json.loads(MESSAGE)
    wanted = {"Message": set(message), "Range": {*message["range"][0]}, "Bearing": {*message["bearing"][0]}}
    assert fields == wanted
