"""The anchors of ranges: the first one of a site, unknown ones, and anchors that move."""

import json

import pytest

from dropanchor_schemas.site import Anchor
from dropanchor_schemas.wire import ENCODING_JSON, anchor_number, encode_json
from dropanchor_service.store.unknown_anchors import FRESH_NS, MAX_LOGGED
from service.ingest.messages import ranges
from support.ingest import IngestBench


def test_the_first_anchor_becomes_the_origin_and_others_are_unknown() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0, anchor=7), ranges(2.0, anchor=8), ranges(3.0, anchor=7))
    assert bench.site.site.anchors == [Anchor(id="7")]
    assert bench.engine.anchors is not None
    assert bench.engine.anchors[["x", "y", "z"]].tolist() == [(0.0, 0.0, 0.0)]
    assert bench.rejected() == {"anchor_unknown": 1}
    assert bench.x_of("a") == [3.0]


def test_an_anchor_named_by_text_is_bound_under_its_name() -> None:
    bench = IngestBench()
    frame = ranges(1.0, anchor=anchor_number("gate"))
    frame.anchor_names = {anchor_number("gate"): "gate"}
    bench.put("a", encode_json(frame), ENCODING_JSON)
    bench.ingest.turn()
    assert [anchor.id for anchor in bench.site.site.anchors] == ["gate"]


@pytest.mark.parametrize("name", ["..", ".", "a\nb", "\u200b", "\ud800"])
def test_an_anchor_that_is_named_by_no_id_is_refused_and_the_ingest_goes_on(name: str) -> None:
    bench = IngestBench(site={"anchors": [{"id": "7"}]})
    message = {"range": [{"t_ns": 1_790_000_000_000_000_000, "anchor": name, "range_m": 1.0}]}
    bench.put("a", json.dumps(message).encode(), ENCODING_JSON)
    bench.send("a", ranges(2.0, anchor=7))
    assert sum(bench.rejected().values()) == 1
    assert bench.x_of("a") == [2.0]


def test_a_bad_range_does_not_bind_an_anchor() -> None:
    bench = IngestBench()
    bench.send("a", ranges(-1.0, anchor=9), ranges(1.0, anchor=7))
    assert [anchor.id for anchor in bench.site.site.anchors] == ["7"]


def test_tracks_start_afresh_when_an_anchor_moves_but_not_when_one_is_added() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0))
    bench.site.set_anchor(Anchor(id="8", x=5.0))
    bench.ingest.turn()
    assert len(bench.engine.configured[0]) == 1
    bench.site.set_anchor(Anchor(id="7", x=1.0))
    bench.ingest.turn()
    assert len(bench.engine.configured[0]) == 2
    assert bench.engine.anchors is not None
    assert bench.engine.anchors["x"].tolist() == [1.0, 5.0]


def test_unknown_anchors_are_logged_once_each_up_to_a_limit(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = IngestBench(site={"anchors": [{"id": "1"}]})
    for anchor in range(2, 1000):
        bench.send("a", ranges(1.0, anchor=anchor), ranges(1.0, anchor=anchor))
    lines = [record.message for record in caplog.records if "unknown_anchors" in record.name]
    assert len(lines) == MAX_LOGGED + 1
    assert lines[0].startswith("tag a hears anchor 2, which this site does not have")
    assert "PUT /api/v1/anchors/2" in lines[0]
    assert "further ones are not logged" in lines[-1]
    assert len(list(bench.tags.unknown_anchors.fresh(bench.clock.now_ns()))) == 1
    assert bench.tags.unknown_anchors.of(0, bench.clock.now_ns() + FRESH_NS) is None
