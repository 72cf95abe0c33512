"""The page can say every sentence of the service in German."""

import json
import shutil
import subprocess
from collections.abc import Iterator

import pytest

from dropanchor_schemas.rejections import Reason
from dropanchor_schemas.zones import Polygon
from dropanchor_service.answers import hints
from dropanchor_service.answers.care import care_of
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.engines.warm_up import CompilationProgress
from dropanchor_service.store import HealthTable, TagTable
from dropanchor_service.store.clock_offsets import ClockOffset, MotionOffset
from dropanchor_service.store.tags import KINDS
from dropanchor_service.store.unknown_anchors import hint_about
from dropanchor_service.zones.shapes import ShapeError, vertices_of

SAY = """
globalThis.location = { search: "?lang=de", hash: "" };
const { said } = await import(process.argv[1] + "/i18n/said.js");
const { words } = await import(process.argv[1] + "/data/format.js");
const { sentences, codes } = JSON.parse(process.argv[2]);
console.log(JSON.stringify([...sentences.map(said), ...codes.map(words)]));
"""


def hints_of_poses() -> Iterator[str]:
    yield from filter(None, hints.HINTS)
    yield hints.RELATIVE_HINT
    yield hints.MOUNT_UNKNOWN
    for template in (hints.LATE, hints.IN_BURSTS, hints.FEW_RANGES):
        yield template.format(8)
    for hears_others in (True, False):
        yield hint_about("9A", hears_others=hears_others)


def hints_of_care() -> Iterator[str]:
    tags, health = TagTable(), HealthTable()
    tag = tags.register("cart")
    for other in ("a", "b", "c"):
        health.record(tags.register(other).row, {"firmware": "2.0"}, 0)
    for spooled in (1e6, 2e6, 3e6, 4e6, 5e6):
        health.record(tag.row, {"battery_fraction": 0.1, "firmware": "1.0", "spool_bytes": spooled}, 0)
    for offset in (
        ClockOffset(2.5, 0.1, None),
        ClockOffset(-2.5, 0.1, None),
        *(ClockOffset(a, 0.01, MotionOffset(b, 0.01)) for a in (3.0, -3.0) for b in (5.0, 1.0, -1.0, -5.0)),
    ):
        for age_s in (400, 9000):
            yield from (care["hint"] for care in care_of(tag, health, int(age_s * 1e9), offset))


def refused_shapes() -> Iterator[str]:
    line, crossing = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 4.0]]
    for points in (line, crossing):
        with pytest.raises(ShapeError) as refused:
            vertices_of(Polygon(type="polygon", points=points))
        yield f"{refused.value}."


def progress() -> Iterator[str]:
    compilation = CompilationProgress()
    yield compilation.sentence
    for what in (
        "the estimator, which takes about a minute",
        "the decoder of messages",
        "the encoder of answers",
        "the zones",
    ):
        compilation.begin(what)
        yield compilation.sentence


def test_every_sentence_and_every_code_has_a_german_translation() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: this test runs a module of the page")
    sentences = sorted({*hints_of_poses(), *hints_of_care(), *refused_shapes(), *progress()})
    codes = [*REASONS, *Reason, *KINDS]
    given = json.dumps({"sentences": sentences, "codes": codes})
    command = [node, "--input-type=module", "--eval", SAY, str(DASHBOARD), given]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    translations = json.loads(run.stdout)
    same = {"imu"}
    untranslated = [
        text
        for text, said in zip([*sentences, *codes], translations, strict=True)
        if said.lower() == text.replace("_", " ").lower() and text not in same
    ]
    assert untranslated == []
