"""The trail of changes: written before a change is made, confirmed afterwards, and kept as long as events."""

import sqlite3
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_schemas.zones import EventType
from dropanchor_service.events.database import Database
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.trail import ChangeTrail, Wanted
from dropanchor_service.store import SiteStore
from dropanchor_service.zones.items import ZoneItems
from support.events import circle, make_older

S = 1_000_000_000


def event(t_ns: int = S) -> Draft:
    return Draft(EventType.TAG_LOST, "a", {"t_ns": t_ns})


class Bench:
    """A site and zones whose changes are noted in a folder."""

    def __init__(self, folder: Path) -> None:
        self.now_ns = S
        self.database = Database(folder)
        self.trail = ChangeTrail(self.database, lambda: self.now_ns)
        self.site = SiteStore(Site(), {}, folder)
        self.zones = ZoneItems.opened(folder).zones
        self.site.trail = self.trail
        self.zones.note_changes(self.trail, "zone")

    def noted(self) -> list[tuple[str, str, bool]]:
        return [(one["kind"], one["item"], one["confirmed"]) for one in self.trail.entries(Wanted(), 100)]


CHANGES: dict[str, Callable[[Bench], object]] = {
    "anchor": lambda bench: bench.site.set_anchor(Anchor(id="7")),
    "site": lambda bench: bench.site.set_site(Site(name="Yard")),
    "tag": lambda bench: bench.site.set_tag("cart", TagSettings()),
    "zone": lambda bench: bench.zones.put("dock", circle("dock")),
}


@pytest.mark.parametrize("kind", CHANGES)
def test_a_change_that_cannot_be_saved_is_taken_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    bench = Bench(tmp_path)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    for store in ("site", "items"):
        monkeypatch.setattr(f"dropanchor_service.store.{store}.write_with_copy", full)
    with pytest.raises(OSError, match="No space"):
        CHANGES[kind](bench)
    assert bench.noted() == []


@pytest.mark.parametrize("kind", CHANGES)
def test_a_change_that_cannot_be_noted_is_not_made(tmp_path: Path, kind: str) -> None:
    bench = Bench(tmp_path)
    with bench.database.transaction() as connection:
        connection.execute("CREATE TRIGGER refuse BEFORE INSERT ON changes BEGIN SELECT RAISE(FAIL, 'no room'); END")
    with pytest.raises(OSError, match="the trail of changes cannot be written"):
        CHANGES[kind](bench)
    after = Bench(tmp_path)
    for one in (bench, after):
        assert (one.site.site, one.site.tags, dict(one.zones.all)) == (Site(), {}, {})


@pytest.mark.parametrize("kind", CHANGES)
def test_a_change_in_which_the_process_died_is_there_and_not_confirmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    bench = Bench(tmp_path)
    monkeypatch.setattr(bench.trail, "_confirm", lambda *_: (_ for _ in ()).throw(SystemExit))
    with suppress(SystemExit):
        CHANGES[kind](bench)
    bench.database.close()
    assert [(one[0], one[2]) for one in Bench(tmp_path).noted()] == [(kind, False)]


def test_a_change_whose_confirmation_fails_is_made(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.site.set_tag("other", TagSettings())
    with bench.database.transaction() as connection:
        connection.execute("CREATE TRIGGER refuse BEFORE UPDATE ON changes BEGIN SELECT RAISE(FAIL, 'no room'); END")
    bench.site.set_anchor(Anchor(id="7"))
    assert bench.noted() == [("anchor", "7", False), ("tag", "other", True)]
    assert bench.site.anchor("7") is not None


def test_a_first_range_is_the_origin_even_when_nothing_can_be_noted(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    with bench.database.transaction() as connection:
        connection.execute("DROP TABLE changes")
    assert bench.site.bind_first("7")
    assert bench.site.anchor("7") is not None


def test_changes_are_kept_as_long_as_events(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    store = EventStore(bench.database, "yard")
    for number in range(6):
        bench.now_ns = number * S
        bench.site.set_tag(f"tag-{number}", TagSettings())
    store.commit([event(number * S) for number in range(6)], {})
    store.prune(keep_from_ns=2 * S, max_bytes=2**40)
    assert [item for _, item, _ in bench.noted()] == ["tag-5", "tag-4", "tag-3", "tag-2"]
    store.prune(keep_from_ns=0, max_bytes=1)  # too large: what is older than the newest event that went goes as well
    assert [item for _, item, _ in bench.noted()] == ["tag-5"]
    store.prune(keep_from_ns=0, max_bytes=1)  # without events, changes make room
    assert bench.noted() == []


def test_an_older_file_gets_a_trail(tmp_path: Path) -> None:
    older = Database(tmp_path)
    EventStore(older, "yard").commit([event()], {})
    make_older(older, 5)
    bench = Bench(tmp_path)
    bench.site.set_anchor(Anchor(id="7"))
    assert bench.noted() == [("anchor", "7", True)]
    assert len(EventStore(bench.database, "yard").after(0, 10)) == 1


def test_a_trail_that_was_never_used_makes_no_file(tmp_path: Path) -> None:
    assert Bench(tmp_path).noted() == []
    assert not list(tmp_path.glob("*.sqlite"))


def test_entries_of_a_damaged_file_raise(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.site.set_anchor(Anchor(id="7"))
    with bench.database.transaction() as connection:
        connection.execute("DROP TABLE changes")
    with pytest.raises(sqlite3.Error):
        bench.noted()
