"""Each parser on the strings that its module is documented to print, whole, in pieces, damaged and after garbage."""

from collections import Counter
from collections.abc import Callable

import pytest

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.dwm1001 import Dwm1001
from dropanchor_tag_client.sources.modules.dwm3001 import Dwm3001
from dropanchor_tag_client.sources.modules.linktrack import LinkTrack
from dropanchor_tag_client.sources.modules.makerfabs import Makerfabs
from dropanchor_tag_client.sources.modules.report import Drop, Parser, Range, Report
from dropanchor_tag_client.sources.modules.trek1000 import Trek1000
from support import module_strings as said
from support.module_strings import EXAMPLES, Pairs
from support.pattern_strings import PATTERN_EXAMPLES, QM33_ONE_MISSING


def parsed(parser: Parser, text: str | bytes) -> list[Pairs]:
    """Return (anchor, range) of each report."""
    data = text if isinstance(text, bytes) else f"{text}\r\n".encode()
    return [[(one.anchor, one.range_m) for one in report.ranges] for report in parser.feed(data)]


DOCUMENTED: list[tuple[Callable[[], Parser], str | bytes, Pairs]] = [
    (MODULES[name].parser, *text) for name, example in EXAMPLES.items() for text in example.documented
]
DOCUMENTED += [(MODULES[name].parser, *text) for name, one in PATTERN_EXAMPLES.items() for text in one.documented]


def test_every_module_of_the_catalogue_has_examples() -> None:
    assert EXAMPLES.keys() | PATTERN_EXAMPLES.keys() == MODULES.keys()


@pytest.mark.parametrize(("parser", "text", "expected"), DOCUMENTED)
def test_what_a_module_is_documented_to_print_becomes_its_ranges(
    parser: Callable[[], Parser], text: str | bytes, expected: Pairs
) -> None:
    whole = parser()
    assert parsed(whole, text) == [expected]
    assert whole.dropped.total() == (text in (said.NOTIFICATION_FOUR, QM33_ONE_MISSING))  # a side that did not answer


@pytest.mark.parametrize(("parser", "text", "expected"), DOCUMENTED)
def test_bytes_that_come_one_by_one_make_no_difference(
    parser: Callable[[], Parser], text: str | bytes, expected: Pairs
) -> None:
    pieces, data = parser(), text if isinstance(text, bytes) else f"{text}\r\n".encode()
    reports = [report for at in range(len(data)) for report in pieces.feed(data[at : at + 1])]
    assert reports == parser().feed(data)
    assert [(one.anchor, one.range_m) for one in reports[0].ranges] == expected


@pytest.mark.parametrize(("parser", "text", "expected"), DOCUMENTED)
@pytest.mark.parametrize("garbage", [b"\xff\x00\x55\xaa" * 100, b"x" * 5000, b"\r\n}{][,;=\r\n", b"\x55\x04\x10\x00"])
def test_a_parser_finds_its_way_again_after_garbage(
    parser: Callable[[], Parser], text: str | bytes, expected: Pairs, garbage: bytes
) -> None:
    tried = parser()
    tried.feed(garbage + b"\r\n")
    found = [parsed(tried, text) for _ in range(25)]  # a false length may hold back 1,024 bytes of what follows
    again: Pairs = [] if tried.dropped[Drop.REPEATED] else expected
    assert found[-1][-1:] == [again]
    assert [expected] in found


def test_a_tag_that_a_line_names_goes_with_each_range() -> None:
    (report,) = Trek1000().feed(b"mc 03 0000031d 000002b1 00000000 00000000 0a67 58 0000e690 a2:3\r\n")
    assert report == Report((Range(0, 0.797, "2"), Range(1, 0.689, "2")))
    (report,) = Makerfabs().feed(said.MAKERFABS.encode() + b"\n")
    assert {one.tag for one in report.ranges} == {"1"}


DAMAGED: list[tuple[Callable[[], Parser], str | bytes, Drop]] = [
    (Dwm1001, said.LEC_DAMAGED, Drop.DAMAGED),
    (Dwm1001, said.LEC.replace("DIST,4", "DIST,3"), Drop.DAMAGED),
    (Dwm1001, said.LEC.replace("AN2", "AN1"), Drop.DAMAGED),
    (Dwm1001, said.LEC.replace("9280", "022E"), Drop.DAMAGED),
    (Dwm1001, said.LEC.replace("3.44", "3.4"), Drop.DAMAGED),
    (Dwm1001, said.LEC[:60] + said.LEC[64:], Drop.DAMAGED),
    (Dwm1001, said.LES.replace("]=5.49", "]5.49"), Drop.DAMAGED),
    (Dwm1001, said.LES.replace("le_us", "le_u"), Drop.DAMAGED),
    (Dwm1001, said.LEC_ONE.replace("0.79", "-0.79"), Drop.NEGATIVE),
    (Dwm1001, said.LEC_ONE.replace("0.79", "-4480.12"), Drop.ABSURD),
    (Dwm1001, said.LEC_ONE.replace("0.79", "4294967.29"), Drop.ABSURD),
    (Dwm1001, said.LEP, Drop.POSITION_ONLY),
    (Dwm1001, "@\x01\x01", Drop.NOT_UNDERSTOOD),
    (Dwm3001, said.NOTIFICATION_NO_ANSWER, Drop.NO_ANSWER),
    (Dwm3001, said.NOTIFICATION_NEGATIVE, Drop.NEGATIVE),
    (Dwm3001, said.NOTIFICATION.replace("n_measurements=1", "n_measurements=2"), Drop.DAMAGED),
    (Dwm3001, said.NOTIFICATION.replace("distance[cm]=71", "distance[cm]="), Drop.DAMAGED),
    (Dwm3001, said.NOTIFICATION[:50] + "}", Drop.DAMAGED),
    (Dwm3001, "SESSION_INFO_NTF: {" + "x" * 5000, Drop.TOO_LONG),
    (Trek1000, said.TREK_MA, Drop.ANCHOR_TO_ANCHOR),
    (Trek1000, said.TREK_MR, Drop.UNCORRECTED),
    (Trek1000, said.TREK_MC[:-4], Drop.DAMAGED),
    (Trek1000, said.TREK_MC.replace("000005a3", "00005a3"), Drop.DAMAGED),
    (Trek1000, said.TREK_MC.replace("000005a3", "0fffffff"), Drop.ABSURD),
    (Trek1000, said.TREK_MC.replace("000005a3", "0000ffff"), Drop.ABSURD),
    (Trek1000, "mc " + "0" * 5000, Drop.TOO_LONG),
    (Makerfabs, "OK", Drop.NOT_UNDERSTOOD),
    (Makerfabs, said.MAKERFABS[:-1], Drop.DAMAGED),
    (Makerfabs, said.MAKERFABS.replace("30", "3-0"), Drop.DAMAGED),
    (Makerfabs, said.MAKERFABS.replace("30", "-30"), Drop.NEGATIVE),
    (LinkTrack, said.NODEFRAME3[:-1] + b"\x00", Drop.CHECKSUM),
    (LinkTrack, b"\x55\x06" + said.NODEFRAME3[2:-1] + bytes([said.NODEFRAME3[-1] + 1]), Drop.OTHER_FRAME),
]


@pytest.mark.parametrize(("parser", "text", "reason"), DAMAGED)
def test_what_cannot_be_used_is_counted_under_its_reason(
    parser: Callable[[], Parser], text: str | bytes, reason: Drop
) -> None:
    tried = parser()
    ranges = parsed(tried, text)
    assert tried.dropped == Counter({reason: 1})
    assert len([one for report in ranges for one in report]) == (
        3 if parser is Trek1000 and reason is Drop.ABSURD else 0
    )


def test_of_a_damaged_line_and_one_written_into_it_the_whole_one_counts() -> None:
    parser = Dwm1001()
    assert parsed(parser, said.LEC[:70] + said.LEC_ONE) == [[("D00C", 0.79)]]


def test_a_notification_that_another_one_cuts_off_is_counted_and_the_other_one_used() -> None:
    parser = Dwm3001()
    assert parsed(parser, said.NOTIFICATION[:60] + said.NOTIFICATION) == [[(1, 0.71)]]
    assert parser.dropped == Counter({Drop.DAMAGED: 1})


def test_corrected_ranges_are_taken_and_uncorrected_ones_only_where_there_are_no_others() -> None:
    both = Trek1000()
    for _ in range(10):
        assert parsed(both, said.TREK_MR) == []
        assert parsed(both, said.TREK_MC) == [said.TREK_MC_RANGES]
    raw_only = Trek1000()
    assert len([report for _ in range(10) for report in parsed(raw_only, said.TREK_MR)]) == 7


def test_the_imu_of_a_linktrack_tag_is_in_si_units_with_the_time_of_the_module() -> None:
    (report,) = LinkTrack().feed(said.NODEFRAME2)
    assert report.device_ns == 9_157_000_000
    assert report.imu is not None
    assert report.imu.acc == pytest.approx((0.224942, 9.73712, -0.05504), abs=1e-5)
    assert report.imu.gyro == pytest.approx((0.02767, 0.00958, -0.04576), abs=1e-5)
    assert report.imu.tag == "1"


def test_a_linktrack_anchor_reports_the_ranges_of_its_tags() -> None:
    frame = bytearray(said.NODEFRAME3)
    frame[4:6] = bytes([1, 9])  # an anchor with the id 9
    for at in range(21, len(frame) - 1, 7):
        frame[at] = 2
    frame[-1] = sum(frame[:-1]) & 0xFF
    (report,) = LinkTrack().feed(bytes(frame))
    assert report.ranges[1] == Range(9, 6.051, "1")
    assert report.imu is None


def test_an_imu_that_says_the_impossible_is_left_out_and_the_ranges_stay() -> None:
    frame = bytearray(said.NODEFRAME2)
    frame[52:56] = b"\x00\x00\xc0\x7f"  # NaN
    frame[-1] = sum(frame[:-1]) & 0xFF
    parser = LinkTrack()
    (report,) = parser.feed(bytes(frame))
    assert report.imu is None
    assert len(report.ranges) == 4
    assert parser.dropped == Counter({Drop.ABSURD: 1})


def test_no_parser_takes_the_strings_of_another_module() -> None:
    for module in MODULES.values():
        for parser, text, _ in DOCUMENTED:
            if parser is not module.parser:
                assert parsed(module.parser(), text) == [], module.name
