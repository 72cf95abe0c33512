"""A tag that was deleted after a checkpoint does not come back with it, and one with an earlier name gets another."""

from pathlib import Path

from dropanchor_schemas.wire import Frame, RangeSample
from service.checkpoints.test_thread import RestorableEngine
from support.ingest import IngestBench

RANGES = Frame(ranges=[RangeSample(1_760_000_000_000_000_000, 7, 1.0)])


def test_a_deleted_tag_stays_deleted_after_a_restart_from_an_older_checkpoint(tmp_path: Path) -> None:
    bench = IngestBench(engine=RestorableEngine(), folder=tmp_path)
    bench.send("kept", RANGES)
    bench.send("gone", RANGES)
    snapshot = bench.service_state().snapshot()
    bench.site.remove_tag("gone", bench.clock.now_ns())
    restarted = IngestBench(engine=RestorableEngine(), folder=tmp_path)
    restarted.service_state().restore(snapshot)
    assert [tag.name for tag in restarted.tags.listed()] == ["kept"]
    assert restarted.x_of(["kept", "gone"]) == [1.0, None]
