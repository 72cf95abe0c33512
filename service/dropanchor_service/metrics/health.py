"""Gauges of what the tags report about themselves. There is none per tag: a fleet has thousands."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.answers.care import REASONS, care_of
from dropanchor_service.estimation.plausibility.verdicts import SENTENCES
from dropanchor_service.store import Sites
from dropanchor_service.store.clock_offsets import ClockOffsets

_EXTREMES: tuple[tuple[str, str, Callable[[Sequence[float]], float], str], ...] = (
    (
        "dropanchor_battery_fraction_min",
        "battery_fraction",
        min,
        "Charge of the emptiest battery; NaN if none is known.",
    ),
    ("dropanchor_tag_temperature_celsius_max", "temperature_c", max, "Temperature of the hottest tag; NaN if unknown."),
    ("dropanchor_rssi_dbm_min", "rssi_dbm", min, "Signal of the tag with the weakest network link; NaN if unknown."),
    ("dropanchor_spool_bytes", "spool_bytes", sum, "Messages that wait on the disks of all tags; NaN if unknown."),
)


class HealthGauges(Collector):
    """Gauges that are read from the store at every scrape."""

    def __init__(self, sites: Sites, now_ns: Callable[[], int], clock_offsets: ClockOffsets) -> None:
        self._sites = sites
        self._now_ns = now_ns
        self._clock_offsets = clock_offsets

    def collect(self) -> Iterable[Metric]:
        now_ns, tags = self._now_ns(), [tag for tag in self._sites.rows.all() if self._sites.is_served(tag)]
        offsets = self._clock_offsets.clock_offsets(now_ns)
        cares = (care_of(tag, self._sites[tag.site].health, now_ns, offsets.get(tag.row)) for tag in tags)
        reasons = Counter(care["reason"] for of_tag in cares for care in of_tag)
        needing = GaugeMetricFamily(
            "dropanchor_tags_needing_care", "Tags that need a person, by reason.", labels=["reason"]
        )
        for reason in REASONS:
            needing.add_metric([reason], reasons[reason])
        yield needing
        faults = GaugeMetricFamily(
            "dropanchor_tags_with_sensor_fault",
            "Tags whose sensors fail their check, by fault.",
            labels=["fault"],
        )
        found = Counter(one.name for tag in tags for one in tag.rows.findings.of(tag.row))
        for name in SENTENCES:
            faults.add_metric([name], found[name])
        yield faults
        yield GaugeMetricFamily(
            "dropanchor_clock_offset_seconds_max",
            "Largest offset between the clocks of a tag's motion and its ranges, either way; NaN if none is known.",
            max((abs(offset.offset_s) for offset in offsets.values()), default=math.nan),
        )
        yield from self._extremes(
            [record.values for tag in tags if (record := self._sites[tag.site].health.of(tag.row))]
        )

    def _extremes(self, values: Sequence[Mapping[str, Any]]) -> Iterable[Metric]:
        yield GaugeMetricFamily("dropanchor_tags_reporting_health", "Tags that have reported health.", len(values))
        for name, field, choose, text in _EXTREMES:
            known = [one[field] for one in values if field in one]
            yield GaugeMetricFamily(name, text, choose(known) if known else math.nan)
