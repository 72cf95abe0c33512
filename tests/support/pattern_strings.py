"""What the modules print that are patterns, as their makers and users document it, and how each behaves at a port."""

import itertools
from collections.abc import Callable
from typing import NamedTuple

from support.module_strings import Pairs
from support.serial_module import Answer, talkative


class PatternExample(NamedTuple):
    """documented: lines, and the ranges of each. answer: how it behaves at a port. options: of the command."""

    documented: list[tuple[str, Pairs]]
    answer: Callable[[], Answer]
    options: tuple[str, ...] = ()


def asked(command: str, *texts: str) -> Answer:
    """Return a module that prints one of these texts after the other, one for each of these commands."""
    received, turn = "", itertools.cycle(texts)

    def answer(sent: bytes) -> bytes:
        nonlocal received
        received += sent.decode("latin-1")
        count = received.count(f"{command}\r\n")
        received = received.rpartition("\r\n")[2]
        return "".join(f"OK\r\n{next(turn)}\r\n" for _ in range(count)).encode()

    return answer


DW1000 = "from: 1786\t Range: 3.21 m\t RX power: -75.30 dBm"
QM33 = (
    '{"Block":12, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":155,"LPDoA_deg":1.00,"LAoA_deg":0.10,"LFoM":100,'
    '"RAoA_deg":0.00,"CFO_100ppm":11}]}'
)
QM33_ONE_MISSING = (
    '{"Block":3948, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":71,"LPDoA_deg":0.00,"LAoA_deg":0.00,"LFoM":0,'
    '"RAoA_deg":0.00,"CFO_100ppm":622},{"Addr":"0x0002","Status":"Err"}]}'
)
PDOA = 'JS006A{"TWR": {"a16":"2E5C","R":3,"T":8605,"D":343,"P":1695,"Xcm":165,"Ycm":165,"O":14,"V":1,"X":53015}}'
UWB_CORE = '{"utime": 15531276,"c": 274,"uid": 186,"ouid": 4660,"raz": [0.696],"rssi": [-79.186],"los": [1.000]}'
RIOT = '{"t": 55158, "src": "02:A1", "dst": "C8:0C", "d_cm": 39}'
REYAX = "+ANCHOR_RCV=TAG1,4,TEST,53 cm"
BU03 = "distance: 1.234000"

PATTERN_EXAMPLES = {
    "dw1000": PatternExample([(DW1000, [("1786", 3.21)])], lambda: talkative(DW1000)),
    "linorobot": PatternExample(
        [("$1782,3.21", [("1782", 3.21)])], lambda: talkative("$1782,3.21"), ("--module", "linorobot")
    ),
    "bu01": PatternExample(
        [("an0:0.55m", [("0", 0.55)]), ("an1:12.40m", [("1", 12.40)])], lambda: talkative("an0:0.55m")
    ),
    "bu03": PatternExample(
        [(BU03, [(0, 1.234)]), ("distance:2 0.530000", [("2", 0.53)])],
        lambda: asked("AT+DISTANCE", BU03, BU03, "distance: 1.234400"),
        ("--module", "bu03"),
    ),
    "reyax": PatternExample(
        [(REYAX, [("TAG1", 0.53)]), ("+ANCHOR_RCV=DAVID123,5,HELLO,40 cm,-72", [("DAVID123", 0.40)])],
        lambda: asked("AT+ANCHOR_SEND=TAG1,4,PING", REYAX),
        ("--module", "reyax", "--poll", "AT+ANCHOR_SEND=TAG1,4,PING"),
    ),
    "uwb-core": PatternExample(
        [
            (UWB_CORE, [(4660, 0.696)]),
            (
                '{"utime": 5214098,"c": 274,"uid": 4867,"ouid": 4660,"raz": [0.778875],"los": [1.000000]}',
                [(4660, 0.778875)],
            ),
        ],
        lambda: talkative(UWB_CORE),
    ),
    "riot": PatternExample([(RIOT, [("C8:0C", 0.39)]), (f"> {RIOT}", [("C8:0C", 0.39)])], lambda: talkative(RIOT)),
    "makerfabs-json": PatternExample(
        [
            ('{"links":[{"A":"1782","R":"1.23"}]}', [("1782", 1.23)]),
            ('{"links":[{"A":"1782","R":"1.0"},{"A":"1783","R":"4.5"}]}', [("1782", 1.0), ("1783", 4.5)]),
            ('{"links":[]}', []),
        ],
        lambda: talkative('{"links":[{"A":"1782","R":"1.23"}]}'),
    ),
    "qm33-json": PatternExample([(QM33, [(1, 1.55)]), (QM33_ONE_MISSING, [(1, 0.71)])], lambda: talkative(QM33)),
    "pdoa": PatternExample([(PDOA, [("2E5C", 3.43)])], lambda: talkative(PDOA)),
}
"""By the name of the module in the catalogue."""
