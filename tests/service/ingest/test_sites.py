"""Several sites share the ingest: each has its own names, anchors, quotas and counters."""

import pytest

from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.answers.answers import Answers
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import ServedSite, Sites, SiteStore
from service.ingest.messages import T
from support.ingest import IngestBench


def bench_of(*sites: tuple[Site, Quota]) -> IngestBench:
    return IngestBench(sites=Sites([(SiteStore(site, {}), quota) for site, quota in sites]))


def send(bench: IngestBench, site: str, tag: str, anchor: int, range_m: float) -> None:
    bench.put(tag, Frame(ranges=[RangeSample(T, anchor, range_m)]), site=site)
    bench.ingest.turn()


def answers_of(bench: IngestBench, site: ServedSite) -> Answers:
    return Answers(site.store, site.tags, bench.latest, now_ns=lambda: T)


def poses_of(bench: IngestBench, site: ServedSite) -> dict[str, tuple[float, str]]:
    """Return x and the anchor of the pose of each tag."""
    poses = answers_of(bench, site).pose_list()["poses"]
    return {pose["tag"]: (pose["x"], pose["anchor"]) for pose in poses}


def two_sites() -> IngestBench:
    return bench_of(
        (Site(id="a", anchors=[Anchor(id="1"), Anchor(id="2")]), Quota()),
        (Site(id="b", anchors=[Anchor(id="2", x=5.0), Anchor(id="3")]), Quota()),
    )


def test_tags_of_one_name_and_anchors_of_one_number_are_different_ones_in_two_sites() -> None:
    bench = two_sites()
    send(bench, "a", "cart", 2, 1.0)
    send(bench, "b", "cart", 2, 2.0)
    send(bench, "b", "lift", 3, 3.0)
    a, b = bench.sites
    assert poses_of(bench, a) == {"cart": (1.0, "2")}
    assert poses_of(bench, b) == {"cart": (2.0, "2"), "lift": (3.0, "3")}
    assert [tag.messages for tag in (*a.tags.all(), *b.tags.all())] == [1, 1, 1]
    assert bench.engine.anchors is not None
    assert bench.engine.anchors["x"].tolist() == [0.0, 0.0, 5.0, 0.0]
    used = [batch.ranges["anchor"].tolist() for batch in bench.engine.batches]
    assert used == [[1], [2], [3]]


def test_an_anchor_of_another_site_is_unknown_and_the_log_says_where_to_add_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = two_sites()
    send(bench, "a", "cart", 3, 1.0)
    a, b = bench.sites
    assert bench.rejected() == {"anchor_unknown": 1}
    assert a.tags.unknown_anchors.of(0, T) == (3, "3")
    assert b.tags.unknown_anchors.of(0, T) is None
    assert "PUT /api/v1/sites/a/anchors/3." in caplog.text


def test_each_site_without_anchors_gets_the_first_one_that_its_tags_range_to() -> None:
    bench = bench_of((Site(id="a"), Quota()), (Site(id="b"), Quota()))
    bench.put("cart", Frame(ranges=[RangeSample(T, 7, 1.0)]), site="a")
    bench.put("cart", Frame(ranges=[RangeSample(T, 8, 2.0), RangeSample(T, 9, 2.0)]), site="b")
    for _ in range(2):
        bench.ingest.turn()
    assert [[anchor.id for anchor in site.store.site.anchors] for site in bench.sites] == [["7"], ["8"]]
    assert [poses_of(bench, site) for site in bench.sites] == [{"cart": (1.0, "7")}, {"cart": (2.0, "8")}]


def test_a_moved_anchor_and_changed_settings_restart_rows_of_their_site_only() -> None:
    bench = two_sites()
    for site in "ab":
        for tag in ("cart", "lift"):
            send(bench, site, tag, 2, 1.0)
    bench.sites[1].store.set_anchor(Anchor(id="3", x=9.0))
    bench.ingest.turn()
    assert [len(times) for times in bench.engine.configured.values()] == [1, 1, 2, 2]
    bench.sites[0].store.set_tag("lift", TagSettings(height_m=2.0))
    bench.ingest.turn()
    assert [len(times) for times in bench.engine.configured.values()] == [1, 2, 2, 2]


def test_the_declination_is_that_of_the_site() -> None:
    bench = bench_of((Site(id="a", declination_rad=0.1), Quota()), (Site(id="b", declination_rad=0.2), Quota()))
    for site in "ab":
        send(bench, site, "cart", 1, 1.0)
    assert [float(times[0]["declination"]) for times in bench.engine.configured.values()] == [0.1, 0.2]


def test_quotas_and_tags_in_quarantine_are_of_their_site() -> None:
    bench = bench_of(
        (Site(id="a"), Quota(max_tags=1)),
        (Site(id="b"), Quota(unknown_tags="quarantine")),
        (Site(id="c"), Quota(max_unconfirmed_tags=1)),
    )
    for site in "abc":
        for tag in ("first", "second"):
            send(bench, site, tag, 1, 1.0)
    a, b, c = bench.sites
    assert [[tag.name for tag in site.tags.all()] for site in (a, b, c)] == [["first"], [], ["first"]]
    assert [pending.name for pending in b.pending_tags.all()] == ["second", "first"]
    assert [pending.name for pending in c.pending_tags.all()] == ["second"]
    assert bench.rejected()["tags_full"] == 1


def test_messages_of_a_site_that_is_not_served_are_rejected() -> None:
    bench = two_sites()
    send(bench, "c", "cart", 1, 1.0)
    assert bench.rejected() == {"key_invalid": 1}
    assert len(bench.sites.rows) == 0


def test_a_deleted_tag_of_one_site_stays_in_the_other() -> None:
    bench = two_sites()
    for site in "ab":
        send(bench, site, "cart", 2, 1.0)
    a, b = bench.sites
    answers_of(bench, a).forget(a.tags.all()[0])
    bench.ingest.turn()
    assert poses_of(bench, a) == {}
    assert poses_of(bench, b) == {"cart": (1.0, "2")}
    assert (a.tags.listed(), [tag.name for tag in b.tags.listed()]) == ([], ["cart"])
    send(bench, "a", "cart", 1, 4.0)
    assert poses_of(bench, a) == {"cart": (4.0, "1")}


def test_a_name_is_online_in_its_site_only() -> None:
    bench = two_sites()
    for site in "ab":
        send(bench, site, "cart", 2, 1.0)
    bench.sites[1].tags.presence.set_token("cart", True)
    assert [site.tags.all()[0].online for site in bench.sites] == [False, True]
    assert [site.tags.presence.count() for site in bench.sites] == [0, 1]
