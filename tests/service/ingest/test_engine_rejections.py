"""What the engine does not use is counted for its tag, as what the ingest rejects is."""

from dropanchor_schemas.site import Anchor, Site, StartPose, TagSettings
from dropanchor_schemas.wire import Frame, HeadingSample, ImuSample, RangeSample
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.store import Tag
from support.ingest import IngestBench

T = 1_760_000_000_000_000_000
STEP_NS = 100_000_000
START = TagSettings(start=StartPose(x=10.0, y=0.0, heading_rad=0.0))


def bench_with(*tags: str) -> IngestBench:
    site = Site(anchors=[Anchor(id="7")])
    return IngestBench(engine=FleetEngine(), site=site, tags=dict.fromkeys(tags, START))


def message(step: int, range_m: float) -> Frame:
    t_ns = T + step * STEP_NS
    return Frame(headings=[HeadingSample(t_ns, 0.0, 0.01)], ranges=[RangeSample(t_ns, 7, range_m, 0.05)])


def tag_of(bench: IngestBench, name: str) -> Tag:
    tag = bench.tags.find(name)
    assert tag is not None
    return tag


def test_samples_that_are_late_for_the_engine_are_counted_for_their_tag() -> None:
    bench = bench_with("late", "in-time")
    for tag in ("late", "in-time"):
        bench.put(tag, message(20, 10.0))
    bench.ingest.turn()
    bench.put("late", message(0, 10.0))
    bench.put("in-time", message(21, 10.0))
    bench.ingest.turn()
    assert tag_of(bench, "late").rejected == bench.rejected() == {"late": 2}
    assert tag_of(bench, "in-time").rejected == {}


def test_the_ranges_of_a_stuck_radio_are_counted_for_their_tag() -> None:
    bench = bench_with("stuck", "sound")
    for step in range(60):
        bench.put("sound", message(step, 10.0 + 0.1 * step))
        bench.put("stuck", message(step, 10.0 + 0.1 * min(step, 49)))
        bench.ingest.turn()
    assert tag_of(bench, "stuck").rejected == bench.rejected() == {"range_stuck": 8}
    assert tag_of(bench, "sound").rejected == {}


def test_imu_samples_that_share_a_time_or_repeat_themselves_are_counted_for_their_tag() -> None:
    bench = bench_with("same-time", "frozen", "sound")
    for step in range(100):
        t_ns, turning = T + step * STEP_NS // 10, (0.0, 0.0, 0.01 * (step % 7))
        for tag, t, gyro in (
            ("sound", t_ns, turning),
            ("same-time", t_ns - t_ns % STEP_NS, turning),
            ("frozen", t_ns, (0.0, 0.0, 0.01) if step > 20 else turning),
        ):
            bench.put(tag, Frame(imu=[ImuSample(t, (0.0, 0.0, 9.81), gyro)]))
        bench.ingest.turn()
    assert tag_of(bench, "same-time").rejected == {"time_repeated": 90}
    assert tag_of(bench, "same-time").used == {"imu": 10}
    stuck = tag_of(bench, "frozen").rejected["imu_stuck"]
    assert 50 < stuck < 60  # it takes a quarter of a second to tell
    assert tag_of(bench, "frozen").used == {"imu": 100 - stuck}
    assert tag_of(bench, "sound").rejected == {}
    assert tag_of(bench, "sound").used == tag_of(bench, "sound").arrived == {"imu": 100}
