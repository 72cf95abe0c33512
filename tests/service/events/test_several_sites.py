"""Sites in one process have zones, rules, events and deliveries of their own, whatever happens in another."""

import sqlite3
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from dropanchor_schemas.events import Event
from dropanchor_schemas.zones import AmbiguousRule, TooCloseRule
from dropanchor_service.delivery.queue import Patience
from dropanchor_service.delivery.thread import DeliveryThread
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, State
from dropanchor_service.events.database import FILE_NAME, Database
from dropanchor_service.events.site_watch import WatchedSite
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.thread import EventThread
from dropanchor_service.events.watcher import Watcher
from dropanchor_service.store import LatestPoses, Sites
from dropanchor_service.zones.items import ZoneItems
from support.delivery import DeliveryBench
from support.events import KEEP, S, circle
from support.receiver import Receiver, running_receiver
from support.sites import T_NS, make_sites
from support.zenoh_router import wait_until


class Company:
    """Sites with zones and events, over poses that the test fills. folder: of each site, by its id."""

    def __init__(self, sites: Sites, folder: Path | None = None) -> None:
        self.sites, self.latest, self.now_ns = sites, LatestPoses(), T_NS
        folders = [None if folder is None else folder / site.id for site in sites]
        self.items = [ZoneItems.opened(one) for one in folders]
        self.stores = [EventStore(Database(one), site.id) for one, site in zip(folders, sites, strict=True)]
        watched = [
            WatchedSite(site.store, site.tags, site.health, items, store.states())
            for site, items, store in zip(sites, self.items, self.stores, strict=True)
        ]
        watcher = Watcher(watched, self.latest, lambda: self.now_ns)
        self.thread = EventThread(watcher, self.stores, KEEP, lambda: self.now_ns, 0.1)

    def stay(self, seconds: float, places: dict[tuple[int, str], float], state: State = State.TRACKING) -> list[str]:
        """Keep tags at these x every 0.2 s. Return what has happened, as `site type tag`."""
        before = [store.newest for store in self.stores]
        for _ in range(round(seconds / 0.2)):
            self.now_ns += S // 5
            poses = np.zeros(len(places), POSE)
            poses["row"] = [self.sites[site].tags.register(tag).row for site, tag in places]
            poses["x"], poses["t_ns"], poses["state"], poses["p_mode"] = [*places.values()], self.now_ns, state, 1.0
            poses["cov"] = np.diag([0.04, 0.01, 0.001])
            self.latest.write(poses, np.empty(0, HYPOTHESIS))
            self.thread.turn()
        return sorted(self._events(before))

    def _events(self, before: Sequence[int]) -> list[str]:
        found = [
            Event.model_validate_json(event.body)
            for store, after in zip(self.stores, before, strict=True)
            for event in store.after(after, 1000)
        ]
        return [f"{e.source.split(':')[-1]} {e.type.value.removeprefix('dropanchor.')} {e.subject}" for e in found]


def test_a_zone_and_a_rule_are_of_their_site_even_where_names_and_places_are_equal() -> None:
    company = Company(make_sites("a", "b", "c"))
    company.items[0].zones.put("dock", circle())
    company.items[1].zones.put("gate", circle("gate", x=50.0))
    company.items[1].zones.put("dock", circle(x=100.0))
    company.items[2].rules.put("apart", TooCloseRule(id="apart", type="too_close", distance_m=3.0))
    near = {(0, "cart"): 0.0, (1, "cart"): 0.0, (2, "cart"): 0.0, (2, "lift"): 30.0}
    assert company.stay(3.0, near) == ["a zone.enter cart"]
    assert company.stay(3.0, near | {(1, "cart"): 100.0, (2, "lift"): 1.0}) == [
        "b zone.enter cart",
        "c tags.too_close cart",
    ]
    assert [[*store.occupants()] for store in company.stores] == [["dock"], ["dock"], []]
    company.items[1].zones.remove("gate")  # the dock gets another column
    company.items[0].zones.put("dock", circle(radius_m=6.0))
    assert company.stay(3.0, near | {(1, "cart"): 100.0, (2, "lift"): 1.0}) == []
    assert company.stay(3.0, near) == ["b zone.exit cart"]


def test_zones_that_another_process_has_saved_are_watched() -> None:
    saved: list[bytes] = []
    owner, successor = ZoneItems.opened(None), Company(make_sites("a", "b"))
    owner.zones.share(None, saved.append)
    owner.zones.put("dock", circle())
    both = {(0, "cart"): 0.0, (1, "cart"): 0.0}
    assert successor.stay(1.0, both) == []
    successor.items[1].zones.share(saved[-1], saved.append)
    assert successor.stay(3.0, both) == ["b zone.enter cart"]


def test_tags_of_a_site_that_has_left_make_no_events_and_a_restart_repeats_none(tmp_path: Path) -> None:
    company = Company(make_sites("a", "b"), tmp_path)
    for items in company.items:
        items.zones.put("dock", circle())
        items.rules.put("doubt", AmbiguousRule(id="doubt", type="ambiguous", after_s=1.0))
    both = {(0, "cart"): 0.0, (1, "cart"): 0.0}
    assert company.stay(3.0, both) == ["a zone.enter cart", "b zone.enter cart"]
    sites = make_sites("b")
    sites.add_former("a")
    left = Company(sites, tmp_path)
    assert left.stay(5.0, {(1, "cart"): 90.0, (0, "cart"): 0.0}) == []
    assert left.stay(3.0, {(1, "cart"): 90.0, (0, "cart"): 90.0}) == ["b zone.exit cart"]


def test_a_site_whose_disk_fails_stops_no_other_and_loses_no_event(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    company = Company(make_sites("a", "b"), tmp_path)
    for items in company.items:
        items.zones.put("dock", circle())

    def fail(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    both = {(0, "cart"): 0.0, (1, "cart"): 0.0}
    with monkeypatch.context() as patched:
        patched.setattr(company.stores[0], "commit", fail)
        assert company.stay(3.0, both) == ["b zone.enter cart"]
        assert company.thread.problems == {0: "events cannot be stored: database or disk is full"}
    assert company.stay(2.0, both) == ["a zone.enter cart"]
    assert company.thread.problems == {}


def test_a_site_without_events_has_no_file_of_them(tmp_path: Path) -> None:
    company = Company(make_sites("a", "b"), tmp_path)
    company.items[0].zones.put("dock", circle())
    company.stay(3.0, {(0, "cart"): 0.0, (1, "cart"): 0.0})
    assert [(tmp_path / site / FILE_NAME).exists() for site in ("a", "b")] == [True, False]


def test_destinations_of_equal_names_get_the_events_of_their_site_and_a_storm_of_one_delays_no_other() -> None:
    benches, receivers = [DeliveryBench() for _ in range(2)], [Receiver(), Receiver()]
    outboxes = [one.outbox for one in benches]
    thread = DeliveryThread(outboxes, Patience(0.2, 10**15), time.time_ns)
    with running_receiver(receivers[0]), running_receiver(receivers[1]), thread:
        for bench, receiver in zip(benches, receivers, strict=True):
            bench.hook(receiver)
        receivers[0].release.clear()  # it does not answer
        benches[0].happen(*(f"tag-{number}" for number in range(500)))
        wait_until(lambda: receivers[0].arrived > 0)
        benches[1].happen("cart")
        wait_until(lambda: benches[1].counts() == (0, 0) and receivers[1].subjects() == ["cart"])
        assert benches[0].counts() == (500, 0)
        receivers[0].release.set()
        wait_until(lambda: benches[0].counts() == (0, 0))
        benches[1].destinations.remove("mes")
        benches[1].happen("lift")
        benches[0].happen("last")
        wait_until(lambda: "last" in receivers[0].subjects())
    assert len(set(receivers[0].subjects())) == 501
    assert receivers[1].subjects() == ["cart"]
