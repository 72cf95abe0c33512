"""Qorvo DWM3001CDK and QM33 with the command-line firmware of the SDK: `SESSION_INFO_NTF` notifications.

A notification takes one line or several: it ends with its closing brace, not with the line.
"""

import re

from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Range, Report, plausible

_MAX_NOTIFICATION = 4096
_START = "SESSION_INFO_NTF:"
_HEAD = re.compile(
    r"\s*\{session_handle=\d+,\s*sequence_number=\d+,\s*block_index=\d+,\s*n_measurements=(\d{1,2}),?\s*"
)
_FIELD = r'[\w ]+(?:\[\w+\])?=(?:"[^"]*"|[^,;"\[\]]*)'
_MEASUREMENT = re.compile(rf"\[({_FIELD}(?:,{_FIELD})*)\]\s*[;,]?\s*")
_FIELDS = re.compile(r'([\w ]+(?:\[\w+\])?)=("[^"]*"|[^,;"\[\]]*)')
_CENTIMETRES = re.compile(r"-?\d{1,6}")
_MAC = re.compile(r"0x[0-9a-fA-F]{1,16}")
_ANSWERED = {'"SUCCESS"', '"Ok"'}

_Fields = dict[str, str]


class Dwm3001:
    """Parse ranges to the other side, which is named by the number of its address (0x0001 is 1)."""

    def __init__(self) -> None:
        self.dropped = Dropped()
        self._text = ""

    def feed(self, data: bytes) -> list[Report]:
        *ended, self._text = (self._text + data.decode("latin-1")).split("}")
        if len(self._text) > _MAX_NOTIFICATION:
            self.dropped[Drop.TOO_LONG] += _START in self._text
            self._text = ""
        return [report for text in ended for report in self._reports(text)]

    def _reports(self, text: str) -> list[Report]:
        """Return the report of the text before a closing brace. Only the part after its last start is complete."""
        _, *begun = text.split(_START)
        if not begun:
            return []
        measurements = _measurements(begun[-1])
        self.dropped[Drop.DAMAGED] += len(begun) - 1 + (measurements is None)
        ranges = [found for fields in measurements or () if (found := self._range(fields)) is not None]
        return [] if measurements is None else [Report(tuple(ranges))]

    def _range(self, fields: _Fields) -> Range | None:
        if fields.get("status") not in _ANSWERED:
            self.dropped[Drop.NO_ANSWER] += 1
            return None
        mac, centimetres = fields.get("mac_address", ""), fields.get("distance[cm]", "")
        if not _MAC.fullmatch(mac) or not _CENTIMETRES.fullmatch(centimetres):
            self.dropped[Drop.DAMAGED] += 1
            return None
        range_m = int(centimetres) / 100
        return Range(_name(int(mac, 16)), range_m) if plausible(range_m, self.dropped) else None


def _measurements(text: str) -> list[_Fields] | None:
    """Return the fields of each measurement; None if the notification is damaged."""
    head = _HEAD.match(text)
    if head is None:
        return None
    at, measurements = head.end(), list[_Fields]()
    while found := _MEASUREMENT.match(text, at):
        measurements.append({name.strip(): value.strip() for name, value in _FIELDS.findall(found[1])})
        at = found.end()
    return measurements if at == len(text) and len(measurements) == int(head[1]) else None


def _name(address: int) -> int | str:
    return address if address < 2**32 else f"{address:016X}"
