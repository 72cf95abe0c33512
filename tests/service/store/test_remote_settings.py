"""What the service sets in the programs of tags is kept, and leaves the estimators alone."""

from pathlib import Path

from dropanchor_schemas.site import RemoteSettings, Site
from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.store import SiteStore
from support.ingest import IngestBench

S = 1_000_000_000
T = 1_760_000_000 * S


def test_remote_settings_are_kept_over_a_restart(tmp_path: Path) -> None:
    store = SiteStore(Site(), {}, tmp_path)
    assert store.remote_settings("a") == RemoteSettings()
    assert store.set_remote("a", RemoteSettings(imu_hz=50.0))
    assert SiteStore(Site(), {}, tmp_path).remote_settings("a") == RemoteSettings(imu_hz=50.0)


def test_settings_change_only_from_the_expected_ones() -> None:
    store = SiteStore(Site(), {})
    store.set_remote("a", RemoteSettings(imu_hz=50.0))
    assert not store.set_remote("a", RemoteSettings(imu_hz=20.0), expected=RemoteSettings())
    assert store.remote_settings("a") == RemoteSettings(imu_hz=50.0)


def test_a_change_does_not_restart_the_estimator_of_the_tag() -> None:
    bench = IngestBench()
    bench.send("a", Frame(ranges=[RangeSample(T, 7, 1.0)]))
    tag = bench.tags.find("a")
    assert tag is not None
    configured = len(bench.engine.configured[tag.row])
    bench.site.set_remote("a", RemoteSettings(imu_hz=50.0))
    bench.send("a", Frame(ranges=[RangeSample(T + S, 7, 1.0)]))
    assert len(bench.engine.configured[tag.row]) == configured
