"""Reports of health reach the store of their tag, or are counted by the reason for which they are not used."""

import json
from typing import Any

from dropanchor_schemas.keys import health_key
from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.ingest.health import REPORTS_PER_S, REPORTS_PER_TURN
from support.ingest import IngestBench

T_NS = 1_800_000_000_000_000_000


def report(bench: IngestBench, tag: str, at_ns: int = T_NS, **values: Any) -> None:
    bench.ingest.health.put(health_key("default", tag), json.dumps(values).encode(), ENCODING_JSON, at_ns)


def values_of(bench: IngestBench, name: str) -> dict[str, Any]:
    tag = bench.tags.find(name)
    record = None if tag is None else bench.health.of(tag.row)
    return {} if record is None else dict(record.values)


def rejected_of(bench: IngestBench, name: str) -> dict[str, int]:
    tag = bench.tags.find(name)
    assert tag is not None
    return dict(tag.rejected)


def test_a_report_registers_its_tag_and_replaces_only_what_it_contains() -> None:
    bench = IngestBench()
    report(bench, "a", battery_fraction=0.9, firmware="1")
    report(bench, "a", battery_fraction=0.8)
    bench.ingest.turn()
    assert values_of(bench, "a") == {"battery_fraction": 0.8, "firmware": "1"}
    assert bench.rejected() == {}


def test_bad_reports_are_counted_for_their_tag_and_harm_no_other() -> None:
    bench = IngestBench()
    report(bench, "b", battery_fraction=0.5)
    report(bench, "a", battery_fraction=7.0, temperature_c=20.0)
    report(bench, "a", battery=0.5)
    bench.ingest.health.put("dropanchor/@v1/default/tag/%61/health", b"{}", ENCODING_JSON, T_NS)
    bench.ingest.turn()
    assert values_of(bench, "a") == {"temperature_c": 20.0}
    assert values_of(bench, "b") == {"battery_fraction": 0.5}
    assert rejected_of(bench, "a") == {"health_absurd": 1, "json_schema": 1}
    assert bench.rejected() == {"health_absurd": 1, "json_schema": 1, "no_health": 1}


def test_a_stranger_gets_no_row_where_only_known_tags_are_admitted() -> None:
    bench = IngestBench(unknown_tags="refuse")
    report(bench, "stranger", battery_fraction=0.5)
    bench.ingest.turn()
    assert bench.tags.find("stranger") is None
    assert bench.rejected() == {"tag_unknown": 1}


def test_a_tag_that_reports_too_often_loses_its_own_reports_only() -> None:
    bench = IngestBench()
    report(bench, "a", battery_fraction=0.5)
    bench.ingest.turn()
    for i in range(10_000):
        report(bench, "a", battery_fraction=i / 10_000)
    report(bench, "b", battery_fraction=0.25)
    bench.ingest.turn()
    assert values_of(bench, "b") == {"battery_fraction": 0.25}
    assert rejected_of(bench, "a") == {"health_too_often": 10_001 - REPORTS_PER_S}
    report(bench, "a", at_ns=T_NS + 1_000_000_000, battery_fraction=0.75)
    bench.ingest.turn()
    assert values_of(bench, "a") == {"battery_fraction": 0.75}


def test_a_fleet_that_reports_at_once_is_taken_over_several_turns() -> None:
    bench = IngestBench()
    for i in range(2 * REPORTS_PER_TURN):
        report(bench, f"tag {i}", battery_fraction=0.5)
    bench.ingest.turn()
    assert len(bench.tags) == REPORTS_PER_TURN
    bench.ingest.turn()
    assert len(bench.tags) == 2 * REPORTS_PER_TURN
    assert bench.rejected() == {}
