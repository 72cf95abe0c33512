"""Parsers with arbitrary bytes and damaged documented strings: they never raise, stay small, and invent nothing."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.report import MAX_RANGE_M, Parser, Report
from support import module_strings as said
from support.pattern_strings import PATTERN_EXAMPLES

TEXTS = [text for name, text in vars(said).items() if name.isupper() and isinstance(text, str)]
TEXTS += [text for example in PATTERN_EXAMPLES.values() for text, _ in example.documented]
FRAMES = [said.NODEFRAME2, said.NODEFRAME3]
WHOLE = [*(f"{text}\r\n".encode() for text in TEXTS), *FRAMES]
PARSERS = [module.parser for module in MODULES.values()]

damaged = st.builds(
    lambda data, at, cut, put: data[: at % len(data)] + put + data[at % len(data) + cut :],
    st.sampled_from(WHOLE),
    st.integers(0, 2000),
    st.integers(0, 6),
    st.binary(max_size=6),
)
streams = st.lists(st.one_of(damaged, st.sampled_from(WHOLE), st.binary(max_size=40)), max_size=12)


def all_reports(parser: Parser, pieces: list[bytes]) -> list[Report]:
    return [report for piece in pieces for report in parser.feed(piece)]


def size(parser: Parser) -> int:
    """Return the count of bytes that a parser keeps for later."""
    kept = [value for part in (parser, getattr(parser, "_lines", None)) for value in vars(part or parser).values()]
    return sum(len(value) for value in kept if isinstance(value, bytes | str))


# Every parser gets every stream: to make one takes longer than to parse it with all of them.
@settings(max_examples=300)
@given(pieces=streams)
def test_whatever_comes_a_parser_reports_only_what_can_be(pieces: list[bytes]) -> None:
    for name, module in MODULES.items():
        tried = module.parser()
        for report in all_reports(tried, pieces):
            assert all(0 <= one.range_m <= MAX_RANGE_M for one in report.ranges), name
            assert all(len(str(one.anchor)) <= 64 and len(one.tag or "") <= 64 for one in report.ranges), name
        assert size(tried) < 10_000, name


@settings(max_examples=100)
@given(pieces=streams, data=st.data())
def test_how_bytes_are_cut_into_pieces_makes_no_difference(pieces: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(pieces)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    cut = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    for name, module in MODULES.items():
        first, second = module.parser(), module.parser()
        assert all_reports(first, [stream]) == all_reports(second, cut), name
        assert first.dropped == second.dropped, name


@pytest.mark.parametrize("parser", PARSERS)
def test_a_stream_without_end_and_without_a_line_takes_no_memory(parser: Callable[[], Parser]) -> None:
    tried = parser()
    for _ in range(200):
        tried.feed(b"\x55\x04\xff\x0fSESSION_INFO_NTF: {" + b"7" * 1000)
    assert size(tried) < 10_000


@settings(max_examples=300)
@given(line=st.sampled_from([said.LEC, said.LES]), at=st.integers(0, 200), cut=st.integers(1, 8))
def test_a_dwm1001_line_with_a_piece_missing_gives_no_range_that_was_not_in_it(line: str, at: int, cut: int) -> None:
    """A cut inside a number of two decimals may leave such a number: positions of anchors are not used, ranges are."""
    true = dict(said.LEC_RANGES if line == said.LEC else said.LES_RANGES)
    broken = line[:at] + line[at + cut :]
    for report in MODULES["dwm1001"].parser().feed(f"{broken}\r\n".encode()):
        wrong = [one for one in report.ranges if true.get(str(one.anchor)) != one.range_m]
        assert len(wrong) <= 1
