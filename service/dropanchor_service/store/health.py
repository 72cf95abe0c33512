"""What the tags report about themselves: the last known values of each tag."""

from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple


class HealthRecord(NamedTuple):
    """What is known about one tag. received_ns: UTC of the last report. spool_rises: how many reports in a row found
    more messages in the tag's spool than the one before."""

    received_ns: int
    values: Mapping[str, Any]
    spool_rises: int


class HealthTable:
    """Health by row. Only the ingest thread writes it; any thread may read it."""

    def __init__(self) -> None:
        self._by_row: dict[int, HealthRecord] = {}
        self._firmware: Counter[str] = Counter()
        self.majority_firmware: str | None = None

    def of(self, row: int) -> HealthRecord | None:
        """Return what is known about the tag in this row; None before its first report."""
        return self._by_row.get(row)

    def record(self, row: int, values: Mapping[str, Any], now_ns: int) -> None:
        """Replace the values that a report contains. The others stay."""
        known = self._by_row.get(row, HealthRecord(0, {}, 0))
        rises = known.spool_rises
        if "spool_bytes" in values:
            rises = rises + 1 if values["spool_bytes"] > known.values.get("spool_bytes", 0) else 0
        self._by_row[row] = HealthRecord(now_ns, {**known.values, **values}, rises)
        if "firmware" in values:
            self._count_firmware(known.values.get("firmware"), values["firmware"])

    def _count_firmware(self, before: str | None, now: str) -> None:
        """Find the firmware of more than half of the tags that report one."""
        if before == now:
            return
        self._firmware[now] += 1
        if before is not None:
            self._firmware[before] -= 1
            self._firmware += Counter()  # removes what no tag has any more
        most, tags = self._firmware.most_common(1)[0]
        self.majority_firmware = most if 2 * tags > self._firmware.total() else None
