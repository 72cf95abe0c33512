"""What rules make of messages, and what they say about those that they cannot use."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Measurement, Received
from dropanchor_tag_client.sources.bridge.rules import TemplateError
from dropanchor_tag_client.sources.bridge.template import Template
from dropanchor_tag_client.sources.bridge.topics import is_filter, matches

NOW_NS = 1_800_000_000_000_000_000
MS = 1_000_000
RULES = """
[[rule]]
topic = "plant/+/uwb"
tag = "{1}-{device.id}"
kind = "range"
each = "anchors"
time_unit = "ms"
fields = { anchor = "id", range_m = "cm", t_ns = "at" }
scale = { range_m = 0.01 }

[[rule]]
topic = "imu/#"
tag = "cart"
kind = "imu"
fields = { acc = ["ax", "ay", "az"], gyro = "g" }
scale = { acc = 9.80665, gyro = 0.5 }

[[rule]]
topic = "radar"
tag = "{who}"
kind = "range"
time_unit = "s"
fields = { anchor = "=yard", range_m = "list.1.d", t_ns = "t" }
"""


@pytest.fixture
def template(tmp_path: Path) -> Template:
    (tmp_path / "rules.toml").write_text(RULES)
    return Template(tmp_path / "rules.toml")


def parsed(template: Template, topic: str, value: Any) -> list[Measurement | Dropped]:
    return list(template.parse(Received(topic, json.dumps(value).encode(), NOW_NS)))


def reasons(found: list[Measurement | Dropped]) -> list[Drop]:
    return [one.reason for one in found if isinstance(one, Dropped)]


def fields(found: list[Measurement | Dropped]) -> list[dict[str, Any]]:
    return [one.fields for one in found if isinstance(one, Measurement)]


def test_a_template_finds_tag_anchor_range_and_time(template: Template) -> None:
    value = {"device": {"id": 7}, "anchors": [{"id": "A", "cm": 321, "at": 1_700_000_000_000}, {"id": 2, "cm": 5}]}
    found = parsed(template, "plant/hall/uwb", value)
    assert found[0] == Measurement(
        "hall-7", "range", {"anchor": "A", "range_m": pytest.approx(3.21), "t_ns": 1_700_000_000_000 * MS}
    )
    assert reasons(found) == [Drop.NOT_UNDERSTOOD]


def test_the_time_may_stand_beside_a_list_but_an_anchor_may_not(template: Template) -> None:
    value = {
        "device": {"id": 7},
        "id": "not the anchor",
        "at": 1_700_000_000_000,
        "anchors": [{"id": 2, "cm": 5}, {"cm": 6}],
    }
    found = parsed(template, "plant/hall/uwb", value)
    assert fields(found) == [{"anchor": 2, "range_m": pytest.approx(0.05), "t_ns": 1_700_000_000_000 * MS}]
    assert reasons(found) == [Drop.NOT_UNDERSTOOD]


def test_a_template_reads_vectors_constants_and_indices(template: Template) -> None:
    (imu,) = fields(parsed(template, "imu/left/front", {"ax": 0, "ay": 0, "az": 1, "g": [1, 2, 3]}))
    assert imu == {"t_ns": NOW_NS, "acc": [0, 0, 9.80665], "gyro": [0.5, 1.0, 1.5]}
    (one,) = fields(parsed(template, "radar", {"who": "x", "t": 1.5, "list": [{}, {"d": 4.5}]}))
    assert one == {"anchor": "yard", "range_m": 4.5, "t_ns": 1_500_000_000}


def test_the_rules_in_the_documentation_work(tmp_path: Path) -> None:
    text = (Path(__file__).parents[4] / "tag_client" / "docs" / "devices.md").read_text()
    (tmp_path / "rules.toml").write_text(text.split("```toml\n")[1].split("```")[0])
    documented = Template(tmp_path / "rules.toml")
    value = {"device": {"id": 7}, "anchors": [{"id": "A", "cm": 321, "at": 5}]}
    assert fields(parsed(documented, "plant/hall/uwb", value)) == [
        {"anchor": "A", "range_m": pytest.approx(3.21), "t_ns": 5 * MS}
    ]
    assert fields(parsed(documented, "imu/a", {"ax": 0, "ay": 0, "az": 1, "g": [0, 0, 1]}))


@pytest.mark.parametrize(
    ("topic", "value"),
    [
        ("plant/hall/uwb", {"device": {"id": 7}, "anchors": 5}),
        ("plant/hall/uwb", {"anchors": [{"id": 1, "cm": 3, "at": 5}]}),
        ("plant/hall/uwb", {"device": {"id": 7}, "anchors": [{"id": 1, "cm": "far", "at": 5}]}),
        ("imu/x", {"ax": 0}),
        ("radar", {"who": "x", "t": "soon", "list": [1, {"d": 2}]}),
        ("radar", 5),
    ],
)
def test_what_a_template_cannot_find_is_named(template: Template, topic: str, value: object) -> None:
    assert reasons(parsed(template, topic, value)) == [Drop.NOT_UNDERSTOOD]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "has no table"),
        ("[[rule]]\ntopic = 1\n", "tag is missing"),
        (RULES.replace('"range"', '"rang"'), "kind is 'rang'"),
        (RULES.replace("anchor = ", "anker = "), "fields are anchor, range_m"),
        (RULES.replace("{1}", "{2}"), "rule 1: tag: there is no {2}; known are {1} (what each + stands for)"),
        (RULES.replace("{1}", "{topic[3]}"), "there is no {topic[3]}; known are"),
        (RULES.replace("{1}", "{topic.0}"), "there is no {topic.0}; known are"),
        (RULES.replace('"=yard"', '"{key}"'), "rule 3: fields.anchor: there is no {key}; known are {topic[0]} to"),
        (RULES.replace('"=yard"', '"{}"'), "there is no {}"),
        (RULES.replace('"=yard"', '"a{1"'), "a { or } stands alone"),
        (RULES.replace("plant/+/uwb", "plant+/uwb"), "a filter such as uwb/+ or uwb/# was expected"),
        (RULES.replace('each = "anchors"', "each = 3"), "the path of a list or an object"),
        (RULES.replace("scale = { range_m = 0.01 }", 'unit = { range_m = "km" }'), "one of m, dm, cm, mm, ft, in was"),
        (RULES.replace("scale = { range_m = 0.01 }", 'unit = { t_ns = "ms" }'), "the times have time_unit"),
        (RULES.replace("scale = { range_m", "scale = { std_m"), "scale names 'std_m', which is not in fields"),
        (RULES.replace("0.01", '"a"'), "scale holds numbers"),
        (RULES.replace("0.01 }", '0.01 }\nunit = { range_m = "cm" }'), "range_m has both a unit and a scale"),
        (RULES.replace('time_unit = "ms"', 'time_zone = "Mars"'), "a name such as UTC or Europe/Berlin"),
        (RULES.replace('time_unit = "ms"', 'retained = "yes"'), "true or false was expected"),
        ("rule = [1]", "a table was expected"),
        (RULES.replace('time_unit = "ms"', 'clock = "gps"'), "utc or boot was expected"),
        (RULES.replace('tag = "cart"', 'tag = "cart"\nclock = "boot"'), 'clock = "boot" needs t_ns in fields'),
        (RULES.replace('"ms"', '"h"'), "time_unit is one of"),
        (RULES.replace("each", "every"), "there is no key 'every'"),
        (RULES + "]", "rules.toml"),
    ],
)
def test_a_wrong_file_of_rules_is_named_with_the_rule(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "rules.toml").write_text(text)
    with pytest.raises(TemplateError, match=re.escape(why)):
        Template(tmp_path / "rules.toml")


def rule(tmp_path: Path, text: str) -> Template:
    """Return the template of one rule for ranges."""
    (tmp_path / "rule.toml").write_text(f'[[rule]]\nkind = "range"\n{text}')
    return Template(tmp_path / "rule.toml")


@pytest.mark.parametrize("anchor", ["{2}", "={2}", "{topic[3]}"])
def test_the_anchor_may_be_a_level_of_the_topic(tmp_path: Path, anchor: str) -> None:
    one = rule(
        tmp_path,
        f'topic = "espresense/devices/+/+"\ntag = "{{topic[2]}}"\nfields = {{anchor = "{anchor}", range_m = "d"}}',
    )
    assert parsed(one, "espresense/devices/badge/kitchen", {"d": 3.2}) == [
        Measurement("badge", "range", {"t_ns": NOW_NS, "anchor": "kitchen", "range_m": 3.2})
    ]


def test_a_payload_that_is_one_number_is_a_range(tmp_path: Path) -> None:
    one = rule(tmp_path, 'topic = "uwb/+/#"\ntag = "{1}"\nfields = {anchor = "A-{topic[2]}", range_m = "{value}"}')
    assert fields(parsed(one, "uwb/cart/7", 5.1)) == [{"t_ns": NOW_NS, "anchor": "A-7", "range_m": 5.1}]
    (dropped,) = parsed(one, "uwb/cart", 5.1)
    assert dropped == Dropped(Drop.NOT_UNDERSTOOD, "uwb/cart: the topic has no level 2: the first one is 0")


@pytest.mark.parametrize(
    ("each", "sources", "payload"),
    [
        ('"anchors"', '"{key}", range_m = "{value}"', {"anchors": {"a1": 3.2, "a2": 4.1}}),
        ('"anchors"', '"{key}", range_m = "m"', {"anchors": {"a1": {"m": 3.2}, "a2": {"m": 4.1}}}),
        (
            '["ids", "uwb.ranges"]',
            '"ids", range_m = "uwb.ranges"',
            {"ids": ["a1", "a2"], "uwb": {"ranges": [3.2, 4.1]}},
        ),
        ('"ranges"', '"a{key}", range_m = "{value}"', {"ranges": [[], 3.2, 4.1]}),
    ],
    ids=["object", "object_of_objects", "parallel_lists", "list_by_index"],
)
def test_each_reads_objects_and_parallel_lists(tmp_path: Path, each: str, sources: str, payload: object) -> None:
    one = rule(tmp_path, f'topic = "uwb"\ntag = "cart"\neach = {each}\nfields = {{anchor = {sources}}}')
    found = [(one["anchor"], one["range_m"]) for one in fields(parsed(one, "uwb", payload))]
    assert found[-2:] == [("a1", 3.2), ("a2", 4.1)]


POZYX = [
    {
        "tagId": "t7",
        "timestamp": 1.5,
        "data": {"anchorData": [{"anchorId": "A", "mm": 3120}, {"anchorId": 2, "mm": 40}]},
    }
]


@pytest.mark.parametrize(
    ("text", "payload", "expected"),
    [
        (
            'tag = "{tagId}"\neach = "[].data.anchorData"\ntime_unit = "s"\nunit = {range_m = "mm"}\n'
            'fields = {anchor = "anchorId", range_m = "mm", t_ns = "timestamp"}',
            POZYX,
            [("t7", "A", 3.12, 1_500 * MS), ("t7", 2, 0.04, 1_500 * MS)],
        ),
        (
            'tag = "{tag}"\neach = "[]"\nfields = {anchor = "a", range_m = "d"}',
            [{"tag": "x", "a": "A", "d": 3.0}, {"tag": "y", "a": "A", "d": 4.0}],
            [("x", "A", 3.0, NOW_NS), ("y", "A", 4.0, NOW_NS)],
        ),
        (
            'tag = "{key}"\neach = "tags[][]"\nfields = {anchor = "a", range_m = "d"}',
            {"tags": {"cart": [{"a": "A", "d": 3.0}, {"a": "B", "d": 4.0}]}},
            [("cart", "A", 3.0, NOW_NS), ("cart", "B", 4.0, NOW_NS)],
        ),
        (
            'tag = "{id}"\neach = "tags[].ranges"\nfields = {anchor = "{key}", range_m = "{value}"}',
            {"tags": [{"id": 7, "ranges": {"A": 3.0}}, {"id": 8, "ranges": {"A": 4.0}}]},
            [("7", "A", 3.0, NOW_NS), ("8", "A", 4.0, NOW_NS)],
        ),
    ],
    ids=["list_of_tags_with_lists", "list", "object_of_lists", "list_of_objects"],
)
def test_each_reads_lists_in_lists(tmp_path: Path, text: str, payload: object, expected: object) -> None:
    found = parsed(rule(tmp_path, f'topic = "u"\n{text}'), "u", payload)
    assert [
        (one.tag, one.fields["anchor"], round(one.fields["range_m"], 6), one.fields["t_ns"])
        for one in found
        if isinstance(one, Measurement)
    ] == expected
    assert not reasons(found)


def test_a_place_in_a_list_is_no_name_of_a_tag(tmp_path: Path) -> None:
    one = rule(tmp_path, 'topic = "u"\ntag = "{key}"\neach = "tags"\nfields = {anchor = "a", range_m = "d"}')
    assert parsed(one, "u", {"tags": [{"a": "A", "d": 3.0}]}) == [
        Dropped(Drop.NOT_UNDERSTOOD, "u: {key} is 0, a place in a list, which is no name of a tag")
    ]


def test_times_since_the_start_of_a_device_become_utc(tmp_path: Path) -> None:
    text = 'topic = "u/+"\ntag = "{1}"\neach = "[]"\nclock = "boot"\ntime_unit = "us"\n'
    one = rule(tmp_path, f'{text}fields = {{anchor = "a", range_m = "d", t_ns = "ts"}}')

    def times(topic: str, arrival_ns: int, *micros: int) -> list[int]:
        value = json.dumps([{"a": "A", "d": 3.0, "ts": ts} for ts in micros]).encode()
        found = list(one.parse(Received(topic, value, arrival_ns)))
        return [(one["t_ns"] - NOW_NS) // 1000 for one in fields(found)]

    assert times("u/a", NOW_NS, 51_000_000, 51_100_000) == [-100_000, 0]
    assert times("u/b", NOW_NS, 7) == [0]
    late_ns = 80_000_000
    assert times("u/a", NOW_NS + 200_000_000 + late_ns, 51_200_000, 51_300_000) == pytest.approx(
        [100_000, 200_000], abs=100
    )
    assert times("u/a", NOW_NS + 60_000_000_000, 5, 100_005) == [59_900_000, 60_000_000]  # it began anew


def test_parallel_lists_of_different_lengths_are_named(tmp_path: Path) -> None:
    one = rule(tmp_path, 'topic = "u"\ntag = "c"\neach = ["ids", "m"]\nfields = {anchor = "ids", range_m = "m"}')
    assert parsed(one, "u", {"ids": [1, 2], "m": [3.2]}) == [
        Dropped(Drop.NOT_UNDERSTOOD, "u: ids has 2 elements and m has 1")
    ]
    assert parsed(one, "u", {"ids": [], "m": []}) == []


def test_a_retained_message_is_refused_unless_the_rule_allows_it(tmp_path: Path) -> None:
    text = 'topic = "u"\ntag = "c"\nfields = {anchor = "=7", range_m = "m"}\n'
    kept = Received("u", b'{"m": 2.5}', NOW_NS, retained=True)
    (dropped,) = rule(tmp_path, text).parse(kept)
    assert isinstance(dropped, Dropped)
    assert dropped.reason is Drop.RETAINED
    assert "retained = true in the rule" in dropped.detail
    assert len(fields(list(rule(tmp_path, f"{text}retained = true").parse(kept)))) == 1


@pytest.mark.parametrize("who", [None, True, {}, []])
def test_a_tag_that_is_no_text_is_named(tmp_path: Path, who: object) -> None:
    one = rule(tmp_path, 'topic = "u"\ntag = "{who}"\nfields = {anchor = "=7", range_m = "m"}')
    (dropped,) = parsed(one, "u", {"m": 1.0, "who": who})
    assert isinstance(dropped, Dropped)
    assert "{who} is" in dropped.detail


@given(
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(st.sampled_from(["device", "id", "anchors", "cm", "at", "who", "t", "list", "d"]), inner)
        ),
        max_leaves=12,
    )
)
def test_no_payload_ends_a_template(value: object, tmp_path_factory: pytest.TempPathFactory) -> None:
    rules = tmp_path_factory.getbasetemp() / "rules.toml"
    rules.write_text(RULES)
    for topic in ("plant/hall/uwb", "imu/x", "radar"):
        parsed(Template(rules), topic, value)


@pytest.mark.parametrize(
    ("pattern", "valid"),
    [("a/+/b", True), ("#", True), ("a/#", True), ("a/#/b", False), ("a+", False), ("a/b#", False), ("", False)],
)
def test_only_filters_that_a_broker_takes_are_taken(pattern: str, valid: bool) -> None:
    assert is_filter(pattern) is valid


@pytest.mark.parametrize(
    ("pattern", "topic", "expected"),
    [
        ("a/b", "a/b", True),
        ("a/+", "a/b", True),
        ("a/+", "a/b/c", False),
        ("a/#", "a/b/c", True),
        ("a/#", "a", True),
        ("a/#", "b/a", False),
        ("+/b", "a/c", False),
    ],
)
def test_a_filter_matches_topics_as_in_mqtt(pattern: str, topic: str, expected: bool) -> None:
    assert matches(pattern, topic) is expected
