"""The page can say every sentence of the service in German."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest

from dropanchor_schemas.rejections import Reason
from dropanchor_schemas.zones import Polygon
from dropanchor_service.answers import hints, unused
from dropanchor_service.answers.care import care_of
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.checkpoints import files as of_checkpoints
from dropanchor_service.checkpoints.layouts import VERSION
from dropanchor_service.cluster import sentences as of_cluster
from dropanchor_service.cluster.watch import Lease, obstacle
from dropanchor_service.engines.warm_up import CompilationProgress
from dropanchor_service.events import database as of_events
from dropanchor_service.history.sqlite import store as of_history
from dropanchor_service.node import sentences as of_node
from dropanchor_service.node.owners import Owner
from dropanchor_service.plans import images as of_images
from dropanchor_service.runtime.kernel_cache import VARIABLE
from dropanchor_service.runtime.recovery import BEGINS_EMPTY, COPY_USED, Recovery
from dropanchor_service.security import share_links as of_links
from dropanchor_service.store import HealthTable, TagTable
from dropanchor_service.store.clock_offsets import ClockOffset, MotionOffset
from dropanchor_service.store.tags import KINDS
from dropanchor_service.store.unknown_anchors import hint_about
from dropanchor_service.store.wrong_times import hint_about_time
from dropanchor_service.zones.shapes import ShapeError, vertices_of
from support.refusals import sentences_about_bodies, sentences_of_the_code

OTHERWISE = "Der Dienst hat abgelehnt: "

SAY = """
import { readFileSync } from "node:fs";
globalThis.location = { search: "?lang=de", hash: "" };
const { refusal, said } = await import(process.argv[1] + "/i18n/said.js");
const { words } = await import(process.argv[1] + "/data/format.js");
const { sentences = [], codes = [], refusals = [] } = JSON.parse(readFileSync(0));
console.log(JSON.stringify([...sentences.map(said), ...codes.map(words), ...refusals.map(refusal)]));
"""


def hints_of_poses() -> Iterator[str]:
    yield from filter(None, hints.HINTS)
    yield hints.RELATIVE_HINT
    yield from (hints.MOUNT_UNKNOWN, hints.RANGES_COME, hints.MOTION_COMES, hints.NEEDS_BOTH.format(5, 120))
    for template in (hints.LATE, hints.IN_BURSTS, hints.FEW_RANGES, hints.ALL_ZERO, hints.LAGS):
        yield template.format(8)
    for what, reasons in unused.WHY.items():
        for why in (*filter(None, reasons.values()), unused.BEHIND.format(3.1)):
            yield unused.NOT_USED.format(399, 401, unused.NOUNS[what], why)
    for hears_others in (True, False):
        yield hint_about("9A", hears_others=hears_others)
    for unit_ns in (1, 10**3, 10**6, 10**9):
        yield hint_about_time(1_800_000_000 * 10**9 // unit_ns if unit_ns > 1 else 0)


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
        ClockOffset(2.5, 0.1, None, corrected=True),
        ClockOffset(-2.5, 0.1, None, corrected=True),
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


def sentences_of_a_cluster() -> Iterator[str]:
    lease = Lease("yard", epoch=4, owner="a", sites="s", layout="l")
    yield from map(of_cluster.standby_of, (lease, replace(lease, owner=""), replace(lease, address="https://a:8080")))
    later, own = replace(lease, layout=f"{VERSION + 1}-{'a' * 16}"), f"{VERSION}-{'b' * 16}"
    for other in (obstacle(lease, "other", "l"), obstacle(lease, "s", "m"), obstacle(later, "s", own)):
        assert other is not None
        yield of_cluster.unable(lease, other)
    yield of_cluster.database_away("yard", "connection refused")
    yield of_cluster.takes_over("yard")
    yield of_cluster.in_doubt("yard")
    yield of_cluster.gone("yard", "an owner with the higher epoch 5 is alive")


def sentences_of_a_node() -> Iterator[str]:
    owner = Owner("017", 3, "machine-1", "https://machine-1.example:8080")
    yield of_node.NO_BUCKETS
    yield of_node.without_owner(owner.bucket)
    yield of_node.socket_followed(owner.bucket)
    for say in (
        *(of_node.without_address, of_node.unreachable, of_node.cut_short, of_node.silent, of_node.former),
        of_node.socket_unreachable,
    ):
        yield say(owner)


def damage(folder: Path) -> Iterator[str]:
    recovery = Recovery(folder)
    for instead in (
        *(BEGINS_EMPTY, COPY_USED, of_history.INSTEAD, of_events.INSTEAD, of_checkpoints.INSTEAD),
        *(of_images.INSTEAD, of_links.ENDED),
    ):
        for why in ("is damaged", "is damaged (file is not a database)", "is empty", "cannot be read (Is a directory)"):
            path = folder / f"{len(list(folder.iterdir()))}.json"
            path.touch()
            recovery.set_aside(path, why, instead)
    yield from recovery.problems()
    yield from Recovery(folder).problems()


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
        for folder in ("/home/.cache/dropanchor/kernels-1", "/tmp/dropanchor-kernels-1"):
            with patch.dict("os.environ", {VARIABLE: folder}):
                yield compilation.sentence


def in_german(**texts: list[str]) -> list[str]:
    """Return what the page makes of `sentences`, `codes` and `refusals`."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: this test runs a module of the page")
    command = [node, "--input-type=module", "--eval", SAY, str(DASHBOARD)]
    run = subprocess.run(command, input=json.dumps(texts), capture_output=True, text=True, timeout=60, check=True)
    translations: list[str] = json.loads(run.stdout)
    return translations


def test_every_sentence_and_every_code_has_a_german_translation(tmp_path: Path) -> None:
    of_processes = {*sentences_of_a_cluster(), *sentences_of_a_node(), *progress(), *damage(tmp_path)}
    sentences = sorted({*hints_of_poses(), *hints_of_care(), *refused_shapes(), *of_processes})
    codes = [*REASONS, *Reason, *KINDS]
    same = {"imu"}
    untranslated = [
        text
        for text, said in zip([*sentences, *codes], in_german(sentences=sentences, codes=codes), strict=True)
        if said.lower() == text.replace("_", " ").lower() and text not in same
    ]
    assert untranslated == []


def test_every_refusal_that_the_page_can_show_has_a_german_translation() -> None:
    of_code, of_bodies = sorted(sentences_of_the_code()), sorted(sentences_about_bodies())
    assert len(of_code) > 80
    assert len(of_bodies) > 60
    parts = [f"body.shape.points.3: {text}" for text in of_bodies]
    several = ["; ".join(f"body.{number}: {text}" for number, text in enumerate(of_bodies[at::30])) for at in range(30)]
    texts = [*of_code, *of_bodies, *parts, *several]
    untranslated = [
        (text, said)
        for text, said in zip(texts, in_german(refusals=texts), strict=True)
        if text in said
        or said.startswith(OTHERWISE)
        or re.search(r"\b(the|should|is|not|must)\b", without_quotes(said))
    ]
    assert untranslated == []


def without_quotes(text: str) -> str:
    """Return the text without what the service quotes, such as values and commands."""
    return re.sub(r"'[^']*'|`[^`]*`|https?:\S*", "", text)


def test_values_inside_a_refusal_are_translated_too_and_the_unknown_is_quoted() -> None:
    refusals = {
        "Authentication failed: the API key has expired. Send an API key or a token in the header `Authorization: "
        "Bearer …`. An operator creates a key with `dropanchor key add NAME --scope read`; for the samples of a tag, "
        "with `--tag TAG` instead of `--scope`.": "Anmeldung gescheitert: Der API-Schlüssel ist abgelaufen. Senden",
        "The API key of 'x' has the scope read; this request needs the scope write.": "Der Zugang 'x' (API-Schlüssel) "
        "hat den Umfang read; diese Anfrage braucht den Umfang write.",
        "List should have at most 2 items after validation, not 3": "Die Liste ist zu lang: 3 statt höchstens 2 Eintr",
        "body.x: Input should be less than or equal to 0.9; body.y: Field required": "body.x: Der Wert darf höchstens "
        "0,9 sein; body.y: Die Angabe fehlt",
        "Nothing that anybody foresaw.": "Der Dienst hat abgelehnt: Nothing that anybody foresaw.",
    }
    for said, wanted in zip(in_german(refusals=list(refusals)), refusals.values(), strict=True):
        assert said.startswith(wanted)
