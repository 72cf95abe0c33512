"""The page has words of its own, in each language, for every sentence that the service can send."""

import pickle
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
from pydantic import ValidationError

from dropanchor_schemas.rejections import Reason
from dropanchor_schemas.sentences import Sentence, phrase_of, said_by, say, with_stop
from dropanchor_schemas.site import TagSettings
from dropanchor_schemas.zones import Circle, Polygon
from dropanchor_service.answers import hints, reason_hints, unused
from dropanchor_service.answers.care import care_of, wrong_clock
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.api.http.closing import reason_of
from dropanchor_service.api.http.errors import message_of
from dropanchor_service.checkpoints import files as of_checkpoints
from dropanchor_service.checkpoints.layouts import VERSION
from dropanchor_service.cluster import sentences as of_cluster
from dropanchor_service.cluster.tenure import Standing, Tenure
from dropanchor_service.cluster.watch import Lease, obstacle
from dropanchor_service.delivery.registry import NO_DESTINATIONS
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.events import database as of_events
from dropanchor_service.history.sqlite import store as of_history
from dropanchor_service.node import sentences as of_node
from dropanchor_service.node.owners import Owner
from dropanchor_service.plans import images as of_images
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.kernel_cache import VARIABLE
from dropanchor_service.runtime.recovery import BEGINS_EMPTY, COPY_USED, DAMAGED, Recovery, damaged, unreadable
from dropanchor_service.security import share_links as of_links
from dropanchor_service.store import HealthTable, TagTable
from dropanchor_service.store.clock_offsets import ClockOffset, MotionOffset
from dropanchor_service.store.tags import KINDS
from dropanchor_service.store.unknown_anchors import hint_about
from dropanchor_service.store.wrong_times import hint_about_time
from dropanchor_service.zones.shapes import ShapeError, vertices_of
from support.refusals import refusals_without_a_code, sentences_about_bodies
from support.sentences import PREFIX, about_sensors, calls, in_words, messages, placeholders


def hints_of_poses() -> Iterator[str]:
    yield from filter(None, reason_hints.HINTS)
    yield hints.RELATIVE_HINT
    yield from (
        hints.MOUNT_UNKNOWN,
        hints.FORWARD_UNKNOWN,
        hints.RANGES_COME,
        hints.MOTION_COMES,
        hints.needs_both(5, 120),
    )
    for say_so in (hints.late, hints.in_bursts, hints.few_ranges, hints.all_zero, hints.lags):
        yield say_so(8)
    for what, reasons in unused.WHY.items():
        for why in (*filter(None, reasons.values()), unused.behind(3.1)):
            yield unused.not_used(399, 401, what, why)
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


def clocks() -> Iterator[str]:
    for error_s in (3.0, -300.0, 18_000.0, -2_592_000.0):
        yield wrong_clock(error_s)
        host = UtcClock()
        host.step(round(error_s * 1e9))
        yield host.problem or ""


def refused_shapes() -> Iterator[str]:
    line, crossing = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 4.0]]
    for points in (line, crossing):
        with pytest.raises(ShapeError) as refused:
            vertices_of(Polygon(type="polygon", points=points))
        yield with_stop(said_by(refused.value))


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
    tenure = Tenure(4, 1.0, lambda: 9.0, lambda: False, asked_s=0.0)
    tenure.saw_epoch(5)
    assert tenure.standing is Standing.LOST
    yield of_cluster.gone("yard", tenure.why_lost)


def sentences_of_a_node() -> Iterator[str]:
    owner = Owner("017", 3, "machine-1", "https://machine-1.example:8080")
    yield of_node.NO_BUCKETS
    yield of_node.without_owner(owner.bucket)
    yield of_node.socket_followed(owner.bucket)
    for said_of in (
        *(of_node.without_address, of_node.unreachable, of_node.cut_short, of_node.silent, of_node.former),
        of_node.socket_unreachable,
    ):
        yield said_of(owner)


def damage(folder: Path) -> Iterator[str]:
    recovery = Recovery(folder)
    for instead in (
        *(BEGINS_EMPTY, COPY_USED, of_history.INSTEAD, of_events.INSTEAD, of_checkpoints.INSTEAD),
        *(of_images.INSTEAD, of_links.ENDED, NO_DESTINATIONS),
    ):
        for why in (DAMAGED, damaged("file is not a database"), unreadable(IsADirectoryError(21, "Is a directory"))):
            path = folder / f"{len(list(folder.iterdir()))}.json"
            path.touch()
            recovery.set_aside(path, why, instead)
    yield from recovery.problems()
    yield from Recovery(folder).problems()


def progress() -> Iterator[str]:
    compilation = CompilationProgress()
    yield compilation.sentence
    for said in (said for said in calls() if said.code in ("the_estimator", "the_decoder", "the_encoder", "the_zones")):
        compilation.begin(say(str(said.code), str(said.text)))
        for folder in ("/home/.cache/dropanchor/kernels-1", "/tmp/dropanchor-kernels-1"):
            with patch.dict("os.environ", {VARIABLE: folder}):
                yield compilation.sentence


def every_hint(tmp_path: Path) -> list[str]:
    of_processes = {*sentences_of_a_cluster(), *sentences_of_a_node(), *progress(), *damage(tmp_path)}
    return sorted({*hints_of_poses(), *hints_of_care(), *clocks(), *refused_shapes(), *of_processes})


def test_every_sentence_has_one_code_and_one_text_which_stand_in_the_code() -> None:
    texts: dict[str | None, set[str | None]] = {}
    for said in calls():
        assert said.code is not None, said.where
        assert said.text is not None, said.where
        assert said.values == placeholders(said.text), said.where
        texts.setdefault(said.code, set()).add(said.text)
    assert len(texts) > 150
    assert {code: found for code, found in texts.items() if len(found) > 1} == {}


def test_the_page_has_a_german_sentence_with_the_same_values_for_every_code_that_the_service_can_send() -> None:
    of_page = {key: placeholders(text) for key, text in messages("de").items() if key.startswith(PREFIX)}
    of_service = {f"{PREFIX}{said.code}": said.values for said in (*calls(), *about_sensors())}
    of_bodies = {f"{PREFIX}{code}": values for code, values in codes_about_bodies().items()}
    assert {key: names for key, names in of_service.items() if of_page.get(key) != names} == {}
    assert {key: names for key, names in of_bodies.items() if not of_page.get(key, {"missing"}) <= names} == {}
    assert of_page.keys() - of_service.keys() - of_bodies.keys() == set()


def test_the_page_has_every_sentence_that_ends_a_websocket_in_english_too() -> None:
    ends = {said.code for said in calls() if re.match(r"(ingest_stream|keys|borders)\.py", said.where)}
    nested = {
        said.code for said in calls() if str(said.code).startswith(("why_key", "why_no_cred", "why_link", "socket_"))
    }
    http_alone = {"other_host", "other_page", "key_form", "key_escapes", "key_shape"}
    assert len(ends) > 10
    assert {f"{PREFIX}{code}" for code in (ends | nested) - http_alone} - messages("en").keys() == set()


def codes_about_bodies() -> dict[str, frozenset[str]]:
    """Return the codes of what is said about wrong values in bodies, and the values of each."""
    found: dict[str, frozenset[str]] = {}
    for text in sentences_about_bodies():
        assert isinstance(text, Sentence), text
        found[text.code] = found.get(text.code, frozenset(text.values)) & frozenset(text.values)
    assert len(found) > 30
    return found


def test_all_that_a_person_can_do_carries_a_code_and_is_german_on_a_german_page(tmp_path: Path) -> None:
    sentences = every_hint(tmp_path)
    assert [text for text in sentences if not isinstance(text, Sentence)] == []
    codes = [*REASONS, *Reason, *KINDS]
    same = {"imu"}
    untranslated = [
        text
        for text, said in zip([*sentences, *codes], in_words("de", sentences, codes=codes), strict=True)
        if (said.lower() == text.replace("_", " ").lower() and text not in same)
        or "{" in said
        or re.search(r"\b(the|is|are|and)\b", without_quotes(said).replace("the-yard", ""))
    ]
    assert untranslated == []


def test_the_english_page_says_what_the_service_says(tmp_path: Path) -> None:
    sentences = every_hint(tmp_path)
    assert in_words("en", sentences) == [str(text) for text in sentences]


def test_every_refusal_that_the_page_can_show_has_a_code() -> None:
    assert refusals_without_a_code() == set()


def test_every_refusal_of_a_body_is_german_on_a_german_page() -> None:
    parts = [
        {"location": "body.shape.points.3", "detail": text, "detail_phrase": phrase_of(text)}
        for text in sorted(sentences_about_bodies())
    ]
    problems = [{"detail": "body: wrong", "errors": [*parts[at::30]]} for at in range(30)]
    for said in in_words("de", refusals=problems):
        assert not re.search(r"\b(the|should|is|not|must)\b", without_quotes(said)), said


def without_quotes(text: str) -> str:
    """Return the text without what the service quotes, such as values and commands."""
    return re.sub(r"'[^']*'|`[^`]*`|\([^)]*\)|https?:\S*", "", text)


def test_every_setting_of_a_tag_has_a_german_name_and_says_in_german_what_it_is() -> None:
    settings = {
        name: schema for name, schema in TagSettings.model_json_schema()["properties"].items() if name != "start"
    }
    of_models = {key.removeprefix("model.") for key in messages("de") if key.startswith("model.")}
    assert of_models == {f"{name}{end}" for name in settings for end in ("", ".what")}
    of_values = {key.removeprefix("value.") for key in messages("en") if key.startswith("value.")}
    for name, schema in settings.items():
        offered = {*schema.get("enum", []), *schema.get("examples", [])}
        assert name.endswith("_unit") or offered <= of_values


def test_values_inside_a_refusal_are_said_in_german_too() -> None:
    expired = say("why_key_expired", "the API key has expired")
    nested = say("credentials_refused", "Authentication failed: {why}. {how}", why=expired, how="Look.")
    with pytest.raises(ValidationError) as refused:
        Circle.model_validate({"type": "circle", "x": 1e12, "radius_m": 1.0})
    errors = [
        {"location": f"body.{part['loc'][0]}", "detail": message_of(part), "detail_phrase": phrase_of(message_of(part))}
        for part in refused.value.errors()
    ]
    problems = [
        {"detail": nested, "detail_phrase": phrase_of(nested)},
        {"detail": "body.x: Input should be …", "errors": errors},
        {"detail": "Nothing that anybody foresaw."},
        {"detail": "A new sentence.", "detail_phrase": {"code": "of_a_later_service", "values": {}}},
    ]
    assert in_words("de", refusals=problems) == [
        "Anmeldung gescheitert: Der API-Schlüssel ist abgelaufen. Look.",
        "body.x: Der Wert darf höchstens 100000 sein; body.y: Die Angabe fehlt",
        "Der Dienst hat abgelehnt: Nothing that anybody foresaw.",
        "Der Dienst hat abgelehnt: A new sentence.",
    ]


def test_a_sentence_with_an_unknown_code_is_shown_as_the_service_says_it() -> None:
    outer = say("not_accepted", "Not accepted: {why}.", why=say("of_a_later_service", "the moon is full"))
    unknown = say("of_a_later_service", "The moon is full.")
    assert in_words("de", [outer, unknown]) == ["Nicht angenommen: the moon is full.", "The moon is full."]


def test_a_decimal_number_in_a_sentence_has_a_comma_in_german() -> None:
    sentence = say("why_behind", "they are older by {seconds} s", seconds="3.1")
    assert "um 3,1 s älter" in in_words("de", [sentence])[0]


def test_a_sentence_keeps_its_code_when_it_is_copied_to_another_process() -> None:
    sentence = say("not_accepted", "Not accepted: {why}.", why=say("is_empty", "is empty"))
    copy = pickle.loads(pickle.dumps(sentence))
    assert (copy, copy.code, copy.values) == (sentence, sentence.code, sentence.values)
    assert copy.values == {"why": "is empty", "why.code": "is_empty"}


@pytest.mark.parametrize("text", [say("needs_key", "Key: {command}.", command="dropanchor key add NAME"), "No code."])
def test_the_end_of_a_websocket_fits_its_frame_and_has_the_code_for_who_asks(text: str) -> None:
    plain, coded = ({"query_string": query} for query in (b"tag=a", b"tag=a&reasons=code"))
    assert reason_of(text, plain) == text
    assert len(reason_of("ü" * 200, coded).encode()) <= 123
    wanted = "Legen Sie einen an mit dropanchor key add NAME." if isinstance(text, Sentence) else "No code."
    assert in_words("de", ends=[reason_of(text, coded)])[0].endswith(wanted)
    long = say("no_ingest_site", "{site} {command}", site="s" * 120, command="c")
    assert reason_of(long, coded) == f"{'s' * 120} c"
