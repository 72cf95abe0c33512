"""A process in a cluster: which settings it refuses, and what a standby says that cannot take over."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from dropanchor_schemas.zones import Zone
from dropanchor_service.api.routes import event_examples
from dropanchor_service.checkpoints import layouts
from dropanchor_service.checkpoints.format import decoded
from dropanchor_service.cluster import leases
from dropanchor_service.cluster import standby as standby_module
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import connect, make_tables
from dropanchor_service.cluster.leases import Claimant, Claimed
from dropanchor_service.cluster.shared_state import CheckpointRow
from dropanchor_service.cluster.standby import Standby
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.ownership.choose import ownership_of
from dropanchor_service.ownership.in_cluster import digest_of_sites
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_service.store import Sites, SiteStore
from dropanchor_service.zones.items import ZoneItems
from support.golden_checkpoint import Drive, golden
from support.postgresql import needs_postgresql, running_postgresql
from support.sites import make_sites

URL = "postgresql://dropanchor@db.example/dropanchor"


def in_cluster(**more: object) -> Settings:
    return Settings.model_validate({"cluster": {"url": URL, "bucket": "yard"}, **more})


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (in_cluster(), "the processes need one router that outlives them: start `dropanchor router`"),
        (in_cluster(engine="paper", zenoh={"connect": ["tcp/r:7447"]}), "the engine paper keeps no state"),
    ],
)
def test_what_could_not_go_on_is_refused(settings: Settings, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        ownership_of(settings, make_sites(), Metrics(), lambda: None)


@pytest.mark.parametrize(
    ("cluster", "sentence"),
    [
        ({"bucket": "yard"}, "`bucket` is of a cluster: set `url`, too"),
        ({"url": "mysql://db/x", "bucket": "yard"}, "cluster.url: an address such as postgresql://"),
        ({"url": "postgresql://a:secret@db/x", "bucket": "yard"}, "the password does not belong here"),
        ({"url": URL, "bucket": "a*"}, "cluster.bucket: "),
        ({"url": URL, "bucket": "yard", "lease_s": 0.1}, "cluster.lease_s: "),
    ],
)
def test_settings_that_cannot_be_are_refused_without_repeating_a_secret(cluster: object, sentence: str) -> None:
    with pytest.raises(SettingsError) as refused:
        load_settings(options={"cluster": cluster}, environment={})
    assert sentence in str(refused.value)
    assert "secret" not in str(refused.value)


def test_the_digest_is_of_what_all_owners_share_and_of_nothing_else() -> None:
    plain = digest_of_sites(in_cluster())
    assert digest_of_sites(in_cluster(http={"port": 9000}, data_dir="/elsewhere", checkpoint_s=3)) == plain
    others: tuple[dict[str, object], ...] = ({"site": {"anchors": [{"id": "1"}]}}, {"tags": {"a": {}}}, {"max_tags": 7})
    for other in others:
        assert digest_of_sites(in_cluster(**other)) != plain


def looks(count: int) -> Callable[[], None]:
    """Return what a standby calls at each look; it raises KeyboardInterrupt after so many."""
    left = iter(range(count))

    def look() -> None:
        if next(left, None) is None:
            raise KeyboardInterrupt

    return look


@needs_postgresql
def test_a_standby_with_other_sites_or_another_layout_says_so_and_waits_until_it_is_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(standby_module, "NOTE_S", 0.0)
    with running_postgresql() as database, database.connect() as connection:
        reach = partial(connect, database.url(), "b")
        first = Standby(reach, "yard", Claimant("a", "https://a.example", "sites", 0.5), "layout")
        assert first.wait(lambda: None)[0].epoch == 1
        connection.execute("UPDATE dropanchor_checkpoint SET layout = 'layout'")
        for sites, layout, why_not in (
            ("others", "layout", "its settings of sites and tags are not those of the owner"),
            ("sites", "newer", "the checkpoint has the layout layout, but this version uses newer"),
        ):
            standby = Standby(reach, "yard", Claimant("b", "", sites, 0.5), layout)
            with pytest.raises(KeyboardInterrupt):
                standby.wait(looks(8))  # more than a lease
            assert standby.sentence == (
                f"This process is a standby of yard and cannot take over: {why_not}. To let it, run dropanchor cluster "
                "accept yard."
            )
            with reach() as also:
                assert leases.status(also)[0].standbys == [f"b (cannot take over: {why_not})"]
        able = Standby(reach, "yard", Claimant("c", "", "sites", 60.0), "layout")
        with pytest.raises(KeyboardInterrupt):
            able.wait(looks(2))
        assert able.sentence == ("This process is a standby of yard: the owner is a at https://a.example, epoch 1.")
        with reach() as also:
            leases.accept_any(also, "yard")
        assert standby.wait(lambda: None)[0].epoch == 2


@needs_postgresql
@pytest.mark.parametrize("moves", [True, False])
def test_a_new_owner_publishes_nothing_while_its_predecessor_does(moves: bool, tmp_path: Path) -> None:
    with running_postgresql() as database:
        with connect(database.url(), "b") as connection:
            make_tables(connection)
            leases.seen_or_new(connection, "yard")
            leases.set_moving(connection, "yard", moves)
            seen = leases.read(connection, "yard")
            assert seen is not None
            claim = leases.claim(connection, seen, Claimant("b", "", "sites", 60.0))
            assert claim is not None
        settings = in_cluster(cluster={"url": database.url(), "bucket": "yard"}, zenoh={"connect": ["tcp/r:7447"]})
        owner = ownership_of(settings, make_sites(), Metrics(), lambda: None, Claimed(claim, boot_s()))
        owner.checkpoints(Drive(tmp_path).state, Recovery())
        owner.stand_by("http://127.0.0.1:8080", {}, lambda: True)
        before = owner.may_serve(), owner.may_publish()
        while_processing: list[bool] = []
        owner.caught_up(lambda: while_processing.append(owner.may_publish()))
        assert (before, while_processing) == (((True, False), [False]) if moves else ((True, True), []))
        assert owner.may_publish()


@needs_postgresql
def test_a_standby_takes_over_from_the_version_before_it_with_all_tracks(tmp_path: Path) -> None:
    with running_postgresql() as database, database.connect() as connection:
        reach, state = partial(connect, database.url(), "new"), Drive(tmp_path).state
        whole = golden(layouts.VERSION - 1)
        before, _ = decoded(whole)
        first = Standby(reach, "yard", Claimant("old", "", "sites", 0.5), before)
        assert first.wait(lambda: None)[0].epoch == 1
        save = "UPDATE dropanchor_checkpoint SET layout = %s, content = %b"
        connection.execute(save, [before, whole], binary=True)
        standby = Standby(reach, "yard", Claimant("new", "", "sites", 0.5), state.layout)
        row = CheckpointRow(reach, "yard", state.layout, state.as_present)
        row.own(standby.wait(lambda: None)[0])
        found, complaints = row.newest()
        assert complaints == []
        assert found is not None
        state.restore(found)
        row.write(state.snapshot())
        row.close()
        assert connection.execute("SELECT epoch, layout FROM dropanchor_checkpoint").fetchone() == (2, state.layout)
        later = f"{layouts.VERSION + 1}-{'0' * 16}"
        connection.execute("UPDATE dropanchor_checkpoint SET layout = %s", [later])
        former = Standby(reach, "yard", Claimant("old", "", "sites", 0.5), state.layout)
        with pytest.raises(KeyboardInterrupt):
            former.wait(looks(8))
        assert f"the checkpoint has the layout {later}, which a later version wrote: install that version" in (
            former.sentence
        )


def test_a_site_goes_on_from_what_another_process_saved_and_saves_there(tmp_path: Path) -> None:
    saved: list[bytes] = []
    owner = make_sites("yard")[0].store
    owner.share(None, saved.append)
    assert saved == []  # nothing was changed yet
    owner.bind_first("7")
    successor = SiteStore(owner.site.model_copy(update={"anchors": []}), {}, tmp_path)
    successor.share(saved[-1], saved.append)
    assert [anchor.id for anchor in successor.site.anchors] == ["7"]
    assert successor.anchor_index(7) == 0
    successor.remove_anchor("7")
    assert len(saved) == 2
    assert not any(tmp_path.iterdir())


def test_zones_go_on_from_what_another_process_saved(tmp_path: Path) -> None:
    saved: list[bytes] = []
    zone = Zone.model_validate(event_examples.ZONE)
    owner, successor = ZoneItems.opened(None).zones, ZoneItems.opened(tmp_path).zones
    owner.share(None, saved.append)
    assert saved == []  # there is none yet
    owner.put("dock", zone)
    successor.share(saved[-1], saved.append)
    assert dict(successor.all) == {"dock": zone}
    successor.remove("dock")
    assert len(saved) == 2
    assert not any(tmp_path.iterdir())


def test_what_a_process_saved_alone_is_saved_for_all_when_it_becomes_the_first_owner(tmp_path: Path) -> None:
    alone = SiteStore(make_sites("yard")[0].store.site, {}, tmp_path)
    alone.bind_first("7")
    saved: list[bytes] = []
    SiteStore(alone.site, {}, tmp_path).share(None, saved.append)
    assert b'"id": "7"' in saved[0]


def test_a_process_that_is_alone_always_serves_and_says_nothing() -> None:
    alone = ownership_of(
        Settings(), Sites([(SiteStore(Settings().site, {}), Settings().quota)]), Metrics(), lambda: None
    )
    alone.stand_by("http://127.0.0.1:8080", {}, lambda: False)
    assert (alone.may_serve(), alone.sentence, alone.gone, alone.impairments()) == (True, "", "", [])
