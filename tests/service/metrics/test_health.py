"""Prometheus sees how many tags need care, and the worst values of the fleet."""

import math

from prometheus_client import CollectorRegistry

from dropanchor_service.metrics.health import HealthGauges
from dropanchor_service.store.clock_offsets import NoClockOffsets
from support.sites import make_sites


def test_the_gauges_are_of_the_whole_fleet() -> None:
    sites, registry = make_sites(), CollectorRegistry()
    tags, health = sites[0].tags, sites[0].health
    registry.register(HealthGauges(sites, lambda: 0, NoClockOffsets()))
    value = registry.get_sample_value
    assert math.isnan(value("dropanchor_battery_fraction_min") or 0.0)
    for name, values in (
        ("a", {"battery_fraction": 0.1, "rssi_dbm": -60.0, "spool_bytes": 5}),
        ("b", {"battery_fraction": 0.9, "rssi_dbm": -90.0, "spool_bytes": 7, "temperature_c": 30.0}),
    ):
        health.record(tags.register(name).row, values, 0)
    tags.register("c")
    assert value("dropanchor_tags_reporting_health") == 2
    assert value("dropanchor_tags_needing_care", {"reason": "battery_low"}) == 1
    assert value("dropanchor_tags_needing_care", {"reason": "no_contact"}) == 0
    assert value("dropanchor_battery_fraction_min") == 0.1
    assert value("dropanchor_rssi_dbm_min") == -90.0
    assert value("dropanchor_tag_temperature_celsius_max") == 30.0
    assert value("dropanchor_spool_bytes") == 12
