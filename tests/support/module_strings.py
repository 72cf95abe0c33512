"""What UWB modules print, as their makers and users document it, and how each behaves at a port."""

import struct
import time
from collections.abc import Callable
from typing import NamedTuple

from support.serial_module import Answer, dwm1001_shell, started_by, talkative
from support.vibration import shaken_acc, shaken_gyro

Pairs = list[tuple[int | str, float]]
"""Anchors and ranges in m."""

LEC = (
    "DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,0.00,8.05,0.00,5.68,AN2,DCAE,8.31,0.00,0.00,6.91,"
    "AN3,15BA,0.00,0.00,0.00,8.72,POS,6.95,5.37,-1.97,52"
)
LEC_RANGES: Pairs = [("022E", 3.44), ("9280", 5.68), ("DCAE", 6.91), ("15BA", 8.72)]
LEC_ONE = "DIST,1,AN0,D00C,0.00,0.00,0.00,0.79"
LEC_DAMAGED = (
    "DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,0.00,8.05,0.00,5.68,AN2,DCAE,8.31,0.00,0.00,6.91,"
    "AN3,15BA,0.00,0,AN3,15BA,0.00,0.00,0.00,8.72,POS,6.95,5.37,-1.97,52"
)
LES = (
    "022E[7.94,8.03,0.00]=3.38 9280[0.00,8.05,0.00]=5.49 DCAE[8.31,0.00,0.00]=6.76 15BA[0.00,0.00,0.00]=8.66 "
    "le_us=3082 est[6.97,5.17,-1.77,53]"
)
LES_RANGES: Pairs = [("022E", 3.38), ("9280", 5.49), ("DCAE", 6.76), ("15BA", 8.66)]
LES_ONE = "022E[0.00,0.00,0.00]=3.38"
LEP = "POS,7.10,5.24,-2.03,53"

NOTIFICATION = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=39, block_index=39, n_measurements=1 "
    '[mac_address=0x0001, status="SUCCESS", distance[cm]=71]}'
)
NOTIFICATION_TWO_LINES = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=0, block_index=0, n_measurements=1\n\r "
    '[mac_address=0x0001, status="SUCCESS", distance[cm]=210, RSSI[dBm]=-78.0]}'
)
NOTIFICATION_FOUR = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=148, block_index=148, n_measurements=4\n"
    ' [mac_address=0x0001, status="SUCCESS", distance[cm]=245];\n'
    ' [mac_address=0x0002, status="SUCCESS", distance[cm]=312];\n'
    ' [mac_address=0x0003, status="RX_TIMEOUT"];\n'
    ' [mac_address=0x0004, status="SUCCESS", distance[cm]=403]}'
)
NOTIFICATION_NO_ANSWER = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=85, block_index=85, n_measurements=1\n"
    ' [mac_address=0x0001, status="RX_TIMEOUT"]}'
)
NOTIFICATION_NEGATIVE = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=12, block_index=0, n_measurements=1\n"
    ' [mac_address=0x0000, status="SUCCESS", distance[cm]=-75]}'
)

TREK_MC = "mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0"
TREK_MC_RANGES: Pairs = [(0, 1.635), (1, 1.443), (2, 1.298), (3, 1.227)]
TREK_MR = "mr 0f 000005a4 000004c8 00000436 000003f9 0958 c0 40424042 a0:0"
TREK_MA = "ma 07 00000000 0000085c 00000659 000006b7 095b 26 00024bed a0:0"
TREK_CLONE = "mc 00 ffffffff ffffffff 00002134 000005dc ffffffff ffffffff ffffffff ffffffff 095f c1 00024c24 a01:0 1a9a"

MAKERFABS = "AT+RANGE=tid:1,mask:04,seq:63,range:(0,0,30,0,0,0,0,0),rssi:(0.00,0.00,-77.93,0.00,0.00,0.00,0.00,0.00)"
MAKERFABS_NAMED = "AT+RANGE=tid:7,mask:0F,seq:128,range:(997,1321,911,738,0,0,0,0),ancid:(0,1,2,3,-1,-1,-1,-1)"

NODEFRAME2 = bytes.fromhex(
    "5504ac000201ba661d000609ffde0a00dfffffe80300faffff1a00000000 00c0120000000000000027ace23c56ed1c3cd2703bbd3257663e"
    "3bcb1b41937061bd25b26b41a1226c41dada6b416d23e92370dddbf7303f5fd6313fba811e3e4769e2bd919b4040c523000040405cd51c00"
    "00001d006d130401006b0c00b19fa6661d0016450101ac1500b4a1a6661d00d3010102481a00ca9fa6661d0038ba01032b1200c6a0a6661d"
    "00644025"
)
NODEFRAME2_RANGES: Pairs = [(0, 3.179), (1, 5.548), (2, 6.728), (3, 4.651)]
NODEFRAME3 = bytes.fromhex(
    "550532000201f81107006fd06e000000 01025a13040100220b00b59f0101a31700b6a00102881c00aa9f0103e61400b8a09a"
)
NODEFRAME3_RANGES: Pairs = [(0, 2.85), (1, 6.051), (2, 7.304), (3, 5.35)]


class ModuleExample(NamedTuple):
    """What the tests need of a module.

    documented: texts that it prints, and the ranges of each. at_port: ways in which it behaves at a port, and the
    ranges that it then reports again and again. text: returns what it prints for a range to the anchor 7. options: of
    the command, which give that anchor its name. has_imu: whether `text` holds IMU samples too.
    """

    documented: list[tuple[str | bytes, Pairs]]
    at_port: list[tuple[Callable[[], Answer], Pairs]]
    text: Callable[[float], bytes]
    options: tuple[str, ...] = ()
    has_imu: bool = False


def _lec(range_m: float) -> bytes:
    return f"DIST,1,AN0,022E,0.00,0.00,0.00,{range_m:.2f}\r\n".encode()


def _notification(range_m: float) -> bytes:
    head = "SESSION_INFO_NTF: {session_handle=1, sequence_number=3, block_index=3, n_measurements=1"
    return f'{head}\n\r [mac_address=0x0007, status="SUCCESS", distance[cm]={range_m * 100:.0f}]}}\r\n'.encode()


def _trek(range_m: float) -> bytes:
    return f"mc 01 {round(range_m * 1000):08x} {0:08x} {0:08x} {0:08x} 095f c1 00024c24 a0:0\r\n".encode()


def _makerfabs(range_m: float) -> bytes:
    ranges = f"range:({range_m * 100:.0f},0,0,0,0,0,0,0),ancid:(7,-1,-1,-1,-1,-1,-1,-1)"
    return f"AT+RANGE=tid:1,mask:01,seq:9,{ranges}\r\n".encode()


def _linktrack(range_m: float) -> bytes:
    imu = (*shaken_gyro(), *shaken_acc())
    frame = bytearray(struct.pack("<BBHBB 34x 6f 38x", 0x55, 4, 133, 2, 1, *imu))
    frame += struct.pack("<I 12x B", time.monotonic_ns() // 1_000_000 % 2**32, 1)
    frame += struct.pack("<BB", 1, 7) + round(range_m * 1000).to_bytes(3, "little") + bytes(8)
    return bytes(frame) + bytes([sum(frame) & 0xFF])


EXAMPLES = {
    "dwm1001": ModuleExample(
        documented=[
            (LEC, LEC_RANGES),
            (f"dwm> {LEC}", LEC_RANGES),
            (LEC_ONE, [("D00C", 0.79)]),
            ("DIST,0", []),
            (LES, LES_RANGES),
            (LES_ONE, [("022E", 3.38)]),
        ],
        at_port=[
            (lambda: talkative(LEC), LEC_RANGES),
            (lambda: dwm1001_shell(LEC), LEC_RANGES),
            (lambda: talkative(LES), LES_RANGES),
        ],
        text=_lec,
        options=("--name", "022E=7"),
    ),
    "dwm3001": ModuleExample(
        documented=[
            (NOTIFICATION, [(1, 0.71)]),
            (NOTIFICATION_TWO_LINES, [(1, 2.10)]),
            (NOTIFICATION_FOUR, [(1, 2.45), (2, 3.12), (4, 4.03)]),
        ],
        at_port=[(lambda: talkative(NOTIFICATION_TWO_LINES), [(1, 2.10)])],
        text=_notification,
    ),
    "trek1000": ModuleExample(
        documented=[(TREK_MC, TREK_MC_RANGES), (TREK_CLONE, [(2, 8.5), (3, 1.5)])],
        at_port=[
            (lambda: talkative(TREK_MR, TREK_MC, TREK_MA), TREK_MC_RANGES),
            (lambda: started_by(b"deca$", TREK_CLONE, echo="n"), [(2, 8.5), (3, 1.5)]),
        ],
        text=_trek,
        options=("--name", "0=7"),
    ),
    "makerfabs": ModuleExample(
        documented=[
            (MAKERFABS, [(2, 0.30)]),
            (MAKERFABS_NAMED, [(0, 9.97), (1, 13.21), (2, 9.11), (3, 7.38)]),
        ],
        at_port=[(lambda: started_by(b"AT+SETRPT=1\r\n", MAKERFABS), [(2, 0.3)])],
        text=_makerfabs,
    ),
    "linktrack": ModuleExample(
        documented=[(NODEFRAME2, NODEFRAME2_RANGES), (NODEFRAME3, NODEFRAME3_RANGES)],
        at_port=[
            (lambda: talkative(NODEFRAME2), NODEFRAME2_RANGES),
            (lambda: talkative(NODEFRAME3), NODEFRAME3_RANGES),
        ],
        text=_linktrack,
        has_imu=True,
    ),
}
"""By the name of the module in the catalogue."""
