"""NoopLoop LinkTrack: the binary frames NodeFrame 2 (ranges and IMU) and NodeFrame 3 (ranges).

Little-endian: 0x55, a mark, u16 length of the frame, …, and as last byte the sum of all others. The accelerometer is
in m/s² and the gyro in rad/s as the module sends them; the vendor's own unpacking does not scale them.
"""

import struct

from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Imu, Range, Report, plausible, plausible_imu

_HEADER = 0x55
_MIN_LENGTH, _MAX_LENGTH = 8, 1024  # the longest frame has some 650 bytes
_ANCHOR, _TAG = 1, 2
_NS_PER_MS = 1_000_000

# role, id | gyro and acc | local time, ms | number of nodes
_FRAME2 = struct.Struct("<4xBB 4x3x9x9x9x 6f 12x6x16x4x I 10x2x B")
# role, id, local time, ms | number of nodes
_FRAME3 = struct.Struct("<4xBBI 4x4x2x B")
_NODE2 = struct.Struct("<BB3s2x4x2x")
_NODE3 = struct.Struct("<BB3s2x")
_MARK2, _MARK3 = 4, 5


class LinkTrack:
    """Parse the ranges and the IMU of a tag, or the ranges of several tags from an anchor. Nodes are named by id."""

    def __init__(self) -> None:
        self.dropped = Dropped()
        self._rest = b""

    def feed(self, data: bytes) -> list[Report]:
        buffer, at, reports = self._rest + data, 0, list[Report]()
        while (at := buffer.find(_HEADER, at)) >= 0 and len(buffer) - at >= _MIN_LENGTH:
            length = int.from_bytes(buffer[at + 2 : at + 4], "little")
            if not _MIN_LENGTH <= length <= _MAX_LENGTH:
                at += 1
                continue
            if len(buffer) - at < length:
                break
            frame = buffer[at : at + length]
            if sum(frame[:-1]) & 0xFF != frame[-1]:
                self.dropped[Drop.CHECKSUM] += buffer[at + 1] in (_MARK2, _MARK3)
                at += 1
                continue
            at += length
            if (report := self._report(frame)) is not None:
                reports.append(report)
        self._rest = buffer[at:] if at >= 0 else b""
        return reports

    def _report(self, frame: bytes) -> Report | None:
        """Return the report of a frame with a valid checksum, None if it is of another kind or incomplete."""
        if frame[1] not in (_MARK2, _MARK3):
            self.dropped[Drop.OTHER_FRAME] += 1
            return None
        layout, node = (_FRAME2, _NODE2) if frame[1] == _MARK2 else (_FRAME3, _NODE3)
        if len(frame) <= layout.size or len(frame) != layout.size + frame[layout.size - 1] * node.size + 1:
            self.dropped[Drop.DAMAGED] += 1
            return None
        ranges = list(node.iter_unpack(frame[layout.size : -1]))
        if frame[1] == _MARK3:
            role, own, local_ms, _ = _FRAME3.unpack_from(frame)
            return Report(self._ranges(role, own, ranges), None, local_ms * _NS_PER_MS)
        role, own, *imu, local_ms, _ = _FRAME2.unpack_from(frame)
        own_imu = self._imu(imu, str(own)) if role != _ANCHOR else None
        return Report(self._ranges(role, own, ranges), own_imu, local_ms * _NS_PER_MS)

    def _ranges(self, role: int, own: int, nodes: list[tuple[int, int, bytes]]) -> tuple[Range, ...]:
        found = []
        for node_role, node, raw in nodes:
            range_m = int.from_bytes(raw, "little", signed=True) / 1000
            if role == _ANCHOR and node_role != _TAG:
                self.dropped[Drop.ANCHOR_TO_ANCHOR] += 1
            elif plausible(range_m, self.dropped):
                found.append(Range(own, range_m, str(node)) if role == _ANCHOR else Range(node, range_m, str(own)))
        return tuple(found)

    def _imu(self, values: list[float], tag: str) -> Imu | None:
        gyro, acc = (values[0], values[1], values[2]), (values[3], values[4], values[5])
        if not any(values):  # a module without an IMU
            return None
        imu = Imu(acc, gyro, tag)
        return imu if plausible_imu(imu, self.dropped) else None
