"""A site that is added to or removed from the settings leaves the tags of the others as they were."""

from pathlib import Path

import pytest

from dropanchor_schemas.site import Anchor, Site
from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import Sites, SiteStore
from service.checkpoints.test_thread import RestorableEngine
from support.ingest import IngestBench

T = 1_760_000_000_000_000_000
X = {"north": 1.0, "south": 20.0, "west": 300.0}


def process(folder: Path, *names: str, engine: RestorableEngine | None = None) -> IngestBench:
    """Start a process that serves these sites, from the checkpoint of the one before, if there is one."""
    sites = Sites(
        [(SiteStore(Site(id=name, anchors=[Anchor(id="5", x=X[name]), Anchor(id="7")]), {}), Quota()) for name in names]
    )
    bench = IngestBench(engine=engine or RestorableEngine(), sites=sites)
    state = bench.service_state()
    snapshot, complaints = CheckpointFolder(folder, state.layout, state.as_present).newest()
    assert complaints == []
    if snapshot is None:
        bench.guarded_engine.follow_sites()
    else:
        state.restore(snapshot)
    return bench


def end(bench: IngestBench, folder: Path) -> None:
    state = bench.service_state()
    CheckpointFolder(folder, state.layout, state.as_present).write(state.snapshot())


def send(bench: IngestBench, site: str, range_m: float) -> None:
    bench.put("cart", Frame(ranges=[RangeSample(T, 7, range_m)]), site=site)
    bench.ingest.turn()


def known(bench: IngestBench) -> dict[str, int]:
    """Return how many messages the tags of each site have sent."""
    return {site.id: sum(tag.messages for tag in site.tags.listed()) for site in bench.sites}


@pytest.mark.parametrize(
    ("first", "then", "last"),
    [
        (("north", "south", "west"), ("west", "north"), ("south", "north", "west")),
        (("north", "south"), ("south",), ("north", "south")),
        (("south",), ("north", "south"), ("south",)),
        (("north", "south"), ("west",), ("south", "north")),
    ],
)
def test_each_tag_goes_on_however_sites_come_and_go(
    tmp_path: Path, first: tuple[str, ...], then: tuple[str, ...], last: tuple[str, ...]
) -> None:
    sent = dict.fromkeys(X, 0)
    for served in (first, then, last):
        engine = RestorableEngine()
        bench = process(tmp_path, *served, engine=engine)
        assert known(bench) == {name: sent[name] for name in served}
        for name in served:
            before = sent[name]
            send(bench, name, 2.0)
            sent[name] += 1
            row = next(tag.row for site in bench.sites if site.id == name for tag in site.tags.all())
            started_afresh = row in engine.started_afresh()
            assert started_afresh == (before == 0), (served, name)
            assert bench.latest.row(row) is not None
        assert engine.anchors is not None
        assert set(engine.anchors["x"].tolist()) >= {X[name] for name in served}
        end(bench, tmp_path)


def test_tags_of_a_site_that_left_are_neither_shown_nor_take_messages(tmp_path: Path) -> None:
    bench = process(tmp_path, "north", "south")
    for site in ("north", "south"):
        send(bench, site, 2.0)
    end(bench, tmp_path)
    bench = process(tmp_path, "north")
    send(bench, "south", 9.0)
    assert [site.id for site in bench.sites] == ["north"]
    assert bench.sites.only is not None
    assert bench.latest.since()[1]["row"].tolist() == [0]
    assert [bench.sites.is_served(tag) for tag in bench.sites.rows.all()] == [True, False]
