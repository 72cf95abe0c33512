"""Patterns: what they find in a line, what they say of a mistake, and that no line and no pattern makes them fail."""

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.patterns.fields import PatternError
from dropanchor_tag_client.sources.modules.patterns.files import module_of_file
from dropanchor_tag_client.sources.modules.patterns.parser import Patterns, pattern
from dropanchor_tag_client.sources.modules.patterns.suggest import suggestion
from dropanchor_tag_client.sources.modules.report import MAX_RANGE_M, Drop, Range, Report
from support.pattern_strings import PATTERN_EXAMPLES

DOCS = Path(__file__).parents[4] / "tag_client" / "docs" / "patterns.md"


def parsed(text: str, line: str) -> tuple[list[Report], dict[Drop, int]]:
    parser = Patterns([pattern(text)])
    return parser.feed(f"{line}\n".encode()), dict(parser.dropped)


def found(text: str, line: str) -> list[Range] | None:
    """Return the ranges of a line, None where the pattern does not fit."""
    reports, _ = parsed(text, line)
    return list(reports[0].ranges) if reports else None


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("from: {anchor} Range: {range:m}", "from: 1786\t Range: 3.21 m\t RX power: -75 dBm", [Range("1786", 3.21)]),
        ("from: {anchor} Range: {range:m}", "[08:00:00] dwm> from: 7 Range:3.21", [Range("7", 3.21)]),
        ("from: {anchor}\\t Range: {range:m}", "from: 1786\t Range: 3.21 m", [Range("1786", 3.21)]),
        ("d={range:cm}", "\x1b[0md=  321\x1b[0m", [Range(0, 3.21)]),
        ("d={range:mm} mm", "d=3210mm", [Range(0, 3.21)]),
        ("d={range:ft}", "d=10", [Range(0, 3.048)]),
        ("d={range:in}", "d=1e2", [Range(0, 2.54)]),
        ("a {anchor:hex} {range:m}", "a 0x001F 2.0", [Range(31, 2.0)]),
        ("{anchor},{range:m},{std:cm}", "A1,2.5,10", [Range("A1", 2.5, None, 0.1)]),
        ("T{tag}/{anchor}/{range:m}", "T4/5/6.5", [Range("5", 6.5, "4")]),
        ("an{anchor}:{range:m}m", "an0:0.55m an1:1.20m", [Range("0", 0.55), Range("1", 1.2)]),
        ("an{anchor}:{range:m}m", "an0:0.an1:1.20m", [Range("1", 1.2)]),
        ("{{{anchor}}} {range:m}", "{A} 3.5", [Range("A", 3.5)]),
        ("DIST,{_},{anchor},{_},{range:m}", "DIST,4,A7,x y,3.5", [Range("A7", 3.5)]),
        (
            "T{tag}:{each} {anchor}={range:m}{/each}{end}",
            "T5: a=1.0 b=2.5",
            [Range("a", 1.0, "5"), Range("b", 2.5, "5")],
        ),
        ("json: d -> range:m, who.id -> anchor", '{"d": "2.5", "who": {"id": 7}}', [Range(7, 2.5)]),
        ("json: d[] -> range:m, d[key] -> anchor", '{"d": {"A": 1.5, "B": 2}}', [Range("A", 1.5), Range("B", 2.0)]),
        ("json: d[] -> range:m, d[key] -> anchor", '{"d": [1.5, 2]}', [Range(0, 1.5), Range(1, 2.0)]),
        ("json: [].d -> range:m", '[08:00] [{"d": 1.5}]', [Range(0, 1.5)]),
        ("json: a[].d -> range:m, a[].s = ok", '{"a":[{"d":1.5,"s":"ok"},{"d":9,"s":"bad"}]}', [Range(0, 1.5)]),
        ("json: d -> range:m, kind = uwb", '{"kind": "imu", "d": 1}', None),
        ("an{anchor}:{range:m}m", "plan0:0.55m", None),
        ("an{anchor}:{range:m}m", "an0:0.55mm", None),
        ("{anchor},{range:m}{end}", "$A,2.5,9", [Range("2.5", 9.0)]),
        ("{start}{anchor},{range:m}{end}", "A,2.5,9", None),
        ("{start}{anchor},{range:m}{end}", "A,2.5", [Range("A", 2.5)]),
        ("d {range:m}", "d 1.2.3", None),
        ("d {range:m}", "d 312 cm", None),
        ("d {range:m}", "d 3.12 m away", [Range(0, 3.12)]),
        ("d {range:m} cm", "d 3.12 cm", [Range(0, 3.12)]),
        ("json: a.d -> range:m", '{"a": [1]}', None),
        ("json: a.d -> range:m", '{"a": ', None),
    ],
)
def test_a_pattern_finds_its_fields(text: str, line: str, expected: list[Range] | None) -> None:
    ranges = found(text, line)
    if expected is None:
        assert ranges is None
    else:
        assert ranges is not None
        assert [rounded(one) for one in ranges] == [rounded(one) for one in expected]


def rounded(one: Range) -> tuple[object, float, str | None, str]:
    return one.anchor, round(one.range_m, 6), one.tag, f"{one.std_m:.6f}"


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("d -4500.5", Drop.ABSURD),
        ("d 4294967.29", Drop.ABSURD),
        ("d 65.535", Drop.ABSURD),
        ("d nan", Drop.ABSURD),
        ("d ovf", Drop.ABSURD),
        ("d -0.75", Drop.NEGATIVE),
        ("d 0.000000", Drop.NO_ANSWER),
        ("distance", Drop.NOT_UNDERSTOOD),
    ],
)
def test_a_number_that_is_no_distance_is_counted_under_its_reason(line: str, reason: Drop) -> None:
    reports, dropped = parsed("d {range:m}", line)
    assert dropped == {reason: 1}
    assert [one for report in reports for one in report.ranges] == []


def test_a_measurement_that_a_module_prints_again_counts_once() -> None:
    parser = MODULES["bu03"].parser()
    reports = parser.feed(b"distance: 1.25\r\nOK\r\ndistance: 1.25\r\nOK\r\ndistance: 1.26\r\n")
    assert [one.range_m for report in reports for one in report.ranges] == [1.25, 1.26]
    assert parser.dropped[Drop.REPEATED] == 1


@pytest.mark.parametrize(
    ("text", "problem", "place"),
    [
        ("from {dist:m}", 'there is no field "dist"; known are anchor, tag, range', 5),
        ("from {anchor}", "nothing here is a range", 0),
        ("d {range}", '"range" needs its unit: range:m, range:cm', 2),
        ("d {range:mile}", '"range" has no unit "mile"', 2),
        ("{anchor:m} {range:m}", '"anchor" has no unit "m"', 0),
        ("{anchor {range:m}", 'a single "{"', 0),
        ("ab}c {range:m}", 'a single "}"', 2),
        ("{anchor}{range:m}", "two fields need something between them", 8),
        ("{range:m} {range:m}", '"range" is there twice', 0),
        ("{ax:g} {ay:g}", "an IMU sample needs az, gx, gy, gz, too", 0),
        ("{each} {range:m}", "{each} and {/each} belong together", 0),
        ("{range:m}{end} x", "nothing can follow {end}", 9),
        ("x{start} {range:m}", "nothing can stand before {start}", 0),
        (" ", "the pattern is empty", 0),
        ("json: d", "PATH -> FIELD was expected", 5),
        ("json: d -> far", 'there is no field "far"', 11),
        ("json: a..b -> range:m", "a path is a chain of names", 7),
        ("json: a[].d -> range:m, b[].a -> anchor", "one list only", 25),
    ],
)
def test_a_mistake_in_a_pattern_is_named_and_its_place_shown(text: str, problem: str, place: int) -> None:
    with pytest.raises(PatternError) as caught:
        pattern(text)
    sentence, shown, mark = str(caught.value).split("\n")
    assert problem in sentence
    assert (shown, mark) == (f"  {text}", f"  {' ' * place}^")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("patterns = [", "is not TOML"),
        ("", "patterns is missing"),
        ('patterns = "d {range:m}"', "patterns is missing or no list of texts"),
        ('patterns = ["d {range:m}"]\nbaud_rate = 1', 'there is no key "baud_rate"; known are patterns'),
        ('patterns = ["d {range:m}"]\nbaud = "fast"', "baud is 'fast', a whole number such as 115200 was expected"),
        ('patterns = ["d {range:m}"]\npoll = "AT"', "poll is 'AT', a list of texts was expected"),
        ('patterns = ["d {range:m}"]\nrepeats = 1', "repeats is 1, true or false was expected"),
        ('patterns = ["d {range:m}"]\nonly_named = 1', "only_named is 1, true or false was expected"),
        ('patterns = ["d {range}"]', '"range" needs its unit'),
    ],
)
def test_a_mistake_in_a_file_is_named_with_the_file(tmp_path: Path, content: str, problem: str) -> None:
    (tmp_path / "mine.toml").write_text(content)
    with pytest.raises(ValueError, match=r"mine\.toml") as caught:
        module_of_file(tmp_path / "mine.toml")
    assert problem in str(caught.value)


def test_the_patterns_in_the_documentation_fit_the_lines_beside_them() -> None:
    rows = [row.split("|")[1:3] for row in DOCS.read_text().splitlines() if row.startswith("| `")]
    assert len(rows) >= 6
    for line, text in rows:
        reports, dropped = parsed(text.strip().strip("`"), line.strip().strip("`"))
        assert reports, line
        assert reports[0].ranges or reports[0].imu, line
        assert not dropped, line


FIELDS = ("{anchor}", "{tag}", "{range:m}", "{std:cm}", "{_}", "{each}", "{/each}", "{start}", "{end}")
CLAUSES = ("json:", "a[].b -> range:m", "a[key] -> anchor", ",", " = 1")
PIECES = st.sampled_from([*FIELDS, *CLAUSES, "{{", *"{}a1.[(*\\é \t"])
LINES = st.one_of(
    st.text(max_size=80),
    st.sampled_from([line for example in PATTERN_EXAMPLES.values() for line, _ in example.documented]),
    st.lists(st.sampled_from(["a", "1", ".", ",", " ", "an0:0.5m ", '{"a":', "[", "]", "}", "{"]), max_size=300).map(
        "".join
    ),
)


@pytest.mark.parametrize(
    ("text", "line", "degrees"),
    [
        ("{anchor} {range:m} {azimuth:deg}", "A 3.0 30", 30.0),
        ("{anchor} {range:m} {azimuth:-deg}", "A 3.0 30", -30.0),
        ("{anchor} {range:m} {azimuth:rad}", "A 3.0 -0.5235987756", -30.0),
        ("{anchor} {range:m} {azimuth:deg}", "A 3.0 350", -10.0),
        ("{anchor} {range:m} {azimuth:deg}", "A 3.0 nan", None),
        ("{anchor} {range:m} {right:cm} {ahead:cm}", "A 3.0 100 100", -45.0),
        ("{anchor} {range:m} {right:cm} {ahead:cm}", "A 3.0 -100 0", 90.0),
        ("{anchor} {range:m} {right:cm} {ahead:cm}", "A 3.0 0 0", None),
        ("json: d -> range:m, a -> azimuth:deg, q -> merit:%", '{"d": 3, "a": 30, "q": 100}', 30.0),
        ("json: d -> range:m, a -> azimuth:deg, q -> merit:%", '{"d": 3, "a": 30, "q": 0}', None),
        ("json: d -> range:m, a -> azimuth:deg", '{"d": 3}', None),
    ],
)
def test_an_azimuth_is_positive_to_the_left_and_may_be_a_place(text: str, line: str, degrees: float | None) -> None:
    one, *_ = found(text, line) or [Range(0, math.nan)]
    assert one.range_m == 3.0
    assert math.degrees(one.azimuth_rad) == pytest.approx(math.nan if degrees is None else degrees, nan_ok=True)


@settings(max_examples=400)
@given(pieces=st.lists(PIECES, max_size=9), lines=st.lists(LINES, max_size=4))
def test_whatever_the_pattern_and_the_line_nothing_fails(pieces: list[str], lines: list[str]) -> None:
    try:
        made = pattern("".join(pieces))
    except PatternError:
        return
    parser = Patterns([made])
    for line in lines:
        for report in parser.feed(line.encode() + b"\n"):
            assert all(0 < one.range_m <= MAX_RANGE_M for one in report.ranges)
            assert all(0 < len(str(one.anchor)) <= 64 for one in report.ranges)


@given(lines=st.lists(LINES, min_size=1, max_size=4))
def test_whatever_the_lines_a_suggestion_fits_the_one_that_it_shows(lines: list[str]) -> None:
    suggested = suggestion(lines)
    if suggested is not None:
        assert pattern(suggested.pattern).found(suggested.line)
