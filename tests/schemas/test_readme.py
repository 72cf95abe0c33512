"""The examples and tables in the README of the protocol agree with the code."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from dropanchor_schemas import keys
from dropanchor_schemas.pose import Pose, PoseFrame
from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    PressureSample,
    RangeSample,
    anchor_number,
    decode_packed,
    encode_packed,
)

README = (Path(__file__).parents[2] / "schemas" / "README.md").read_text()
T = 1_760_000_000_000_000_000
EXAMPLE = Frame(
    imu=[ImuSample(T, (0.0, 0.0, 9.8125), (0.0, 0.0, 0.125), (0.0, 20.0, -44.0))],
    ranges=[RangeSample(T + 10_000_000, 1, 12.25, 0.125), RangeSample(T + 12_500_000, anchor_number("L0"), 3.5)],
    headings=[HeadingSample(T + 20_000_000, 1.5, 0.0625)],
    bearings=[BearingSample(T + 30_000_000, 1, -0.5)],
    pressures=[PressureSample(T + 40_000_000, 101_324.0, 21.5)],
    sequence=41,
    boot_id=0xDEADBEEF,
)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)


def bytes_of(hexadecimal: str) -> bytes:
    """Return the bytes at the start of each line, without the explanation after several blanks."""
    return bytes.fromhex(" ".join(re.split(r"\s{3,}", line)[0] for line in hexadecimal.splitlines()))


def rows(heading: str) -> list[list[str]]:
    """Return the cells of the table under a heading, without the header row."""
    section = README.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_worked_example_decodes_to_the_described_samples() -> None:
    (example,) = blocks("hex")
    assert repr(decode_packed(bytes_of(example))) == repr(EXAMPLE)
    assert encode_packed(EXAMPLE) == bytes_of(example)


def test_the_json_example_contains_the_same_samples() -> None:
    decoded = decode_json(blocks("json")[1].encode())
    assert isinstance(decoded, Frame)
    assert decoded.anchor_names == {anchor_number("L0"): "L0"}
    decoded.anchor_names = {}
    assert repr(decoded) == repr(EXAMPLE)


def test_the_simplest_message_decodes() -> None:
    decoded = decode_json(blocks("json")[0].encode())
    assert isinstance(decoded, Frame)
    assert decoded.ranges[0][:3] == (T, 1, 12.34)
    assert keys.samples_key("default", "my-tag") in README


def test_the_keys_are_those_of_the_code() -> None:
    of_tag = [keys.samples_key, keys.tag_alive_key, keys.health_key, keys.settings_key, keys.pose_key, keys.event_key]
    spelled = [*of_tag, None, keys.anchor_key, keys.service_alive_key]
    *of_sites, (of_owner, *_) = rows("Keys")
    assert keys.owner_key("B", 7) == of_owner.strip("`").replace("<bucket>", "B").replace("<epoch>", "7")
    for (key, *_), make in zip(of_sites, spelled, strict=True):
        made = keys.poses_key("S") if make is None else make("S", "I")
        assert re.sub("<site>", "S", re.sub("<(tag|anchor|id)>", "I", key.strip("`"))) == made
    assert keys.samples_key("default", "tag 1").split("/")[4] == "tag%201"


def test_the_anchor_numbers_are_right() -> None:
    table = {row[0].strip("`"): int(row[1]) for row in rows("Anchor numbers")}
    assert table == {identifier: anchor_number(identifier) for identifier in table}
    assert len(table) == 5


def one_range(payload: bytes) -> None:
    frame = decode_packed(payload)
    assert isinstance(frame, Frame), frame
    assert (frame.sequence, frame.boot_id, frame.boot_clock) == (41, 0xDEADBEEF, False)
    (sample,) = frame.ranges
    assert sample.anchor == 1
    assert sample.range_m == 12.25
    assert math.isnan(sample.std_m)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_the_c_program_writes_a_payload_that_decodes(tmp_path: Path) -> None:
    (program,) = blocks("c")
    (tmp_path / "tag.c").write_text(program)
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["gcc", *flags, "tag.c", "-o", "tag"], cwd=tmp_path, check=True)
    one_range(subprocess.run([tmp_path / "tag"], check=True, capture_output=True).stdout)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_javascript_writes_a_payload_that_decodes() -> None:
    (program,) = blocks("js")
    one_range(subprocess.run(["node", "-e", program], check=True, capture_output=True).stdout)


def test_the_poses_in_the_examples_are_those_of_the_contract() -> None:
    section = README.split("\n## Poses\n")[1].split("\n## ")[0]
    pose, error, frame = (
        json.loads(text) for text in re.findall(r"^```json\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)
    )
    assert Pose.model_validate(pose).tag == "tag-1"
    assert list(error) == ["error"]
    assert len(PoseFrame.model_validate(frame).tags) == 2
    assert {len(column) for column in frame.values() if isinstance(column, list)} == {2}


def test_every_json_block_is_json() -> None:
    for block in blocks("json"):
        json.loads(block)
