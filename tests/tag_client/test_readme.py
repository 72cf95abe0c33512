"""The programs in the README of the tag client work as described."""

import json
import re
from pathlib import Path

import pytest

from dropanchor_tag_client.sources.publish import samples_of
from support.commands import python
from support.listening import listening
from support.zenoh_router import wait_until

README = (Path(__file__).parents[2] / "tag_client" / "README.md").read_text()
PROGRAMS = re.findall(r"^```python\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)


def test_a_tag_in_five_lines_publishes(router_endpoint: str) -> None:
    assert len([line for line in PROGRAMS[0].splitlines() if line]) <= 5
    program = PROGRAMS[0].replace('TagClient("cart-1")', f'TagClient("cart-1", connect="{router_endpoint}")')
    assert program != PROGRAMS[0]
    with listening(router_endpoint) as heard:
        done = python("-c", program)
        assert done.returncode == 0, done.stderr
        wait_until(lambda: heard.frames)
    assert heard.keys == ["dropanchor/@v1/default/tag/cart-1/samples"]
    assert heard.ranges() == [pytest.approx(3.21, abs=1e-6)]
    assert heard.frames[0].imu[0].acc == pytest.approx((0.0, 0.0, 9.81), abs=1e-6)


def test_the_programs_with_credentials_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("ca.pem", "cart-1.pem", "cart-1.key"):
        Path(name).touch()
    bundle = Path("cart-1")
    bundle.mkdir()
    for name in ("ca.pem", "tag.pem", "tag.key"):
        (bundle / name).touch()
    (bundle / "tag.json").write_text('{"tag": "cart-1", "site": "yard", "connect": "tls/router.example:7447"}')
    for program in PROGRAMS[1:]:
        done = python("-c", program)
        assert done.returncode == 0, done.stderr
    assert len(PROGRAMS) == 3


def test_the_example_lines_for_publish_are_valid_samples() -> None:
    lines = re.findall(r"`(\{.*?\})`", README)
    assert len(lines) == 2
    assert [kind for line in lines for kind, _ in samples_of(json.dumps(json.loads(line)).encode())] == ["range", "imu"]
