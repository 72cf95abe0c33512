"""A module is recognised by what only it prints, and a proposal fits what was heard."""

import pytest

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.patterns.parser import pattern
from dropanchor_tag_client.sources.modules.patterns.suggest import suggestion
from dropanchor_tag_client.sources.modules.recognise import recognised, understands
from support.lures import LURES
from support.module_strings import EXAMPLES
from support.pattern_strings import PATTERN_EXAMPLES

PRINTED = {
    name: [text if isinstance(text, bytes) else f"{text}\r\n".encode() for text, ranges in example.documented if ranges]
    for name, example in (EXAMPLES | PATTERN_EXAMPLES).items()
}
SILENT_UNTIL_NAMED = {"linorobot"} | {name for name, module in MODULES.items() if module.poll}


@pytest.mark.parametrize("name", MODULES)
def test_no_module_understands_what_another_one_prints(name: str) -> None:
    others = [text for other, texts in PRINTED.items() if other != name for text in texts]
    assert others
    assert [text for text in others if understands(MODULES[name].parser(), text)] == []


@pytest.mark.parametrize("name", MODULES)
def test_a_module_is_recognised_by_its_measurements_unless_other_boards_print_the_like(name: str) -> None:
    found = {module and module.name for text in PRINTED[name] if (module := recognised(3 * text)) or True}
    assert found == ({None} if name in SILENT_UNTIL_NAMED else {name})


@pytest.mark.parametrize("line", LURES)
def test_a_line_of_another_board_is_no_module(line: str) -> None:
    assert recognised(3 * f"{line}\r\n".encode()) is None


LINES = [
    (["from: 1786\t Range: 3.21 m\t RX power: -75.3 dBm"], "from: {anchor} Range: {range:m} m"),
    (["an0:0.55m", "an1:1.20m"], "an{anchor}:{range:m}m"),
    (["RNG peer 0x12 dist 1234 mm"], "peer {anchor} dist {range:mm} mm"),
    (["peer=AB:CD dist=312 cm", "peer=AB:CE dist=300 cm"], "peer={anchor} dist={range:cm} cm"),
    (["> 0 - Status: 0x0, Distance: 312 cm, Peer MAC: 11:11"], "Distance: {range:cm} cm, Peer MAC: {anchor}"),
    (["1452ms, 3121mm, -81dBm", "1462ms, 3127mm, -81dBm"], "{_}ms, {range:mm}mm"),
    (["1452ms, 3121mm", "1462ms, 3127mm", "1472ms, 3130mm"], "{t:ms}ms, {range:mm}mm"),
    (["5ms, 3121mm", "6ms, 3127mm", "5ms, 3130mm"], "{_}ms, {range:mm}mm"),
    (["A1=3.21m A2=4.50m"], "{anchor}={range:m}m"),
    (["Distance: 312", "GOT DATA - Type: 1"], "Distance: {range:cm}"),
    (["d=1.5", "d=2.5"], "d={range:m}"),
    (["dist 45000"], "dist {range:mm}"),
    (["Distance (m): 3.21"], "Distance (m): {range:m}"),
    (["t=5120 mm=300"], None),
    (['{"ranges":{"A1":3.2,"A2":4.5}}'], "json: ranges[key] -> anchor, ranges[] -> range:m"),
    (
        ["Accel: 0.1, 0.2, 9.8 Gyro: 1, 2, 3 deg/s"],
        "Accel: {ax:m/s2}, {ay:m/s2}, {az:m/s2} Gyro: {gx:deg/s}, {gy:deg/s}, {gz:deg/s}",
    ),
    (['{"results":[{"Addr":"0x0001","D_cm":155}]}'], "json: results[].Addr -> anchor, results[].D_cm -> range:cm"),
    (['{"anchor":"A","distance":3.2}'], "json: anchor -> anchor, distance -> range:m"),
    (
        ["ax:0 ay:0 az:9.8 gx:0 gy:0 gz:1"],
        "ax:{ax:m/s2} ay:{ay:m/s2} az:{az:m/s2} gx:{gx:rad/s} gy:{gy:rad/s} gz:{gz:rad/s}",
    ),
    (["5,0.1,0.2,1.0,1,2,3"], "{_},{ax:g},{ay:g},{az:g},{gx:deg/s},{gy:deg/s},{gz:deg/s}"),
    (["hello", "Temp: 23.5 C", "[] {"], None),
    (["3.2m 4.5m"], None),
]


@pytest.mark.parametrize(("lines", "expected"), LINES)
def test_a_proposal_fits_all_lines_of_its_form(lines: list[str], expected: str | None) -> None:
    made = suggestion(lines)
    assert (made and made.pattern) == expected
    assert expected is None or pattern(expected).found(lines[0])
