"""Distance, speed and time in zones over REST: as JSON and CSV, of a period, and who may see it."""

import csv
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI

from dropanchor_schemas.figures import Figures
from dropanchor_schemas.site import TagSettings
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import State
from dropanchor_service.events.drafts import StateKey, States, StateValue, Stay
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from service.api.routes.test_track import RETENTION, SECOND
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench
from support.events import circle

START_NS = T_NS - 120 * SECOND


@pytest.fixture
def parts() -> EventParts:
    """Zones in which the tag `a` was twice and still is, `b` is, and `c`, without poses, was."""
    made = EventParts.in_memory("default")
    made.items.zones.put("dock", circle("dock").model_copy(update={"name": "Loading dock"}))
    made.items.zones.put("empty", circle("empty"))
    stays = [
        Stay("a", "dock", START_NS - 50 * SECOND, START_NS + 10 * SECOND),
        Stay("a", "dock", START_NS + 20 * SECOND, START_NS + 25 * SECOND),
        Stay("c", "gone", START_NS + 100 * SECOND, T_NS),
    ]
    inside: States = {StateKey("zone", "dock", tag): StateValue(1, START_NS + 40 * SECOND) for tag in ("a", "b")}
    inside[StateKey("rule", "dock", "a")] = StateValue(1, 1)  # not a zone
    made.store.commit([], inside, stays)
    return made


@pytest.fixture
def bench(tmp_path: Path) -> ApiBench:
    """`a` drives for two minutes, `b` stands and is silent after one minute."""
    made = make_api_bench(folder=tmp_path, retention=RETENTION)
    for second in range(0, 121, 5):
        made.move("a", x=2.0 * second, speed=2.0, t_ns=START_NS + second * SECOND)
        if second <= 60:
            made.move("b", x=1.0, t_ns=START_NS + second * SECOND)
    made.write_history()
    made.answers.site.set_tag("b", TagSettings(group="forklifts"))
    return made


@pytest.fixture
def app(bench: ApiBench, parts: EventParts) -> FastAPI:
    return bench.app(events=parts)


def figures(app: FastAPI, query: str = "", **options: Any) -> Figures:
    response = ask(app, "GET", f"/api/v1/figures?{query}", **options)
    assert response.status_code == 200, response.text
    return Figures.model_validate(response.json())


def in_zones(found: Figures) -> dict[str, list[tuple[str, float, int]]]:
    return {tag.tag: [(time.zone, time.inside_s, time.stays) for time in tag.zones] for tag in found.tags}


def test_each_tag_has_its_way_and_its_time_in_zones_until_it_was_last_known(app: FastAPI) -> None:
    found = figures(app, f"from={START_NS}&to={T_NS}")
    assert [zone.model_dump() for zone in found.zones] == [
        {"zone": "dock", "name": "Loading dock"},
        {"zone": "gone", "name": None},
    ]
    a, b, c = found.tags
    assert (a.distance_m, a.tracked_s, a.mean_speed_mps, a.max_speed_mps) == (240, 120, 2, 2)
    assert (b.distance_m, b.tracked_s, c.poses, c.mean_speed_mps) == (0, 60, 0, None)
    # `a` was inside at the start and is at the end; `b` was last seen after 60 s.
    assert in_zones(found) == {"a": [("dock", 95, 3)], "b": [("dock", 30, 1)], "c": [("gone", 20, 1)]}


def test_the_period_cuts_every_stay(app: FastAPI) -> None:
    found = figures(app, f"from={START_NS + 5 * SECOND}&to={START_NS + 22 * SECOND}")
    assert in_zones(found) == {"a": [("dock", 7, 2)], "b": []}
    assert in_zones(figures(app, f"from={START_NS - 70 * SECOND}&to={START_NS - 60 * SECOND}")) == {}


def test_tags_groups_and_zones_can_be_chosen(app: FastAPI) -> None:
    period = f"from={START_NS}&to={T_NS}"
    assert list(in_zones(figures(app, f"{period}&tags=a,x"))) == ["a"]
    assert list(in_zones(figures(app, f"{period}&group=forklifts"))) == ["b"]
    assert list(in_zones(figures(app, f"{period}&group=&tags=a,b,c"))) == ["a", "c"]
    assert in_zones(figures(app, f"{period}&zones=gone")) == {"a": [], "b": [], "c": [("gone", 20, 1)]}


def test_a_table_has_a_line_for_each_tag_and_a_column_for_each_zone(bench: ApiBench, parts: EventParts) -> None:
    bench.move("=1+1", x=0.0)
    bench.write_history()
    response = ask(bench.app(events=parts), "GET", f"/api/v1/figures?from={START_NS}&to={T_NS}&format=csv")
    assert response.headers["content-type"].startswith("text/csv")
    assert response.headers["content-disposition"] == 'attachment; filename="figures.csv"'
    head, *lines = csv.reader(response.text.splitlines())
    assert head[:3] + head[-2:] == ["tag", "from_utc", "to_utc", "in dock s", "in gone s"]
    assert [[line[0], *line[3:]] for line in lines] == [
        ["'=1+1", "1", "0.0", "0.0", "", "0.0", "0", "0"],
        ["a", "25", "120.0", "240.0", "2.0", "2.0", "95.0", "0"],
        ["b", "13", "60.0", "0.0", "0.0", "0.0", "30.0", "0"],
        ["c", "0", "0.0", "0.0", "", "", "0", "20.0"],
    ]


def test_speeds_of_a_tag_that_was_never_tracked_are_empty_cells(bench: ApiBench, parts: EventParts) -> None:
    bench.move("d", x=0.0, state=State.AMBIGUOUS)
    bench.write_history()
    response = ask(bench.app(events=parts), "GET", f"/api/v1/figures?from={START_NS}&to={T_NS}&format=csv")
    (line,) = [line for line in csv.DictReader(response.text.splitlines()) if line["tag"] == "d"]
    assert (line["poses"], line["mean_speed_mps"], line["max_speed_mps"]) == ("1", "", "")


@pytest.mark.parametrize("query", ["from=2&to=1", "from=0", "tags=", "format=gpx", "points=3", "zones="])
def test_invalid_parameters_are_refused(app: FastAPI, query: str) -> None:
    assert kind_of(ask(app, "GET", f"/api/v1/figures?{query}")) == "invalid-request"


def test_events_that_cannot_be_read_are_a_problem(
    app: FastAPI, parts: EventParts, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr(parts.store.database, "snapshot", fail)
    assert kind_of(ask(app, "GET", "/api/v1/figures")) == "events-unreadable"


@pytest.mark.parametrize(("limit", "seen"), [({"tag": "a"}, ["a"]), ({"group": "forklifts"}, ["b"])])
def test_a_share_link_shows_the_figures_of_its_tags_however_one_asks(
    bench: ApiBench, parts: EventParts, tmp_path: Path, limit: dict[str, str], seen: list[str]
) -> None:
    links, keys = ShareLinks(tmp_path), ApiKeys(tmp_path)
    app = bench.app(authenticator=Authenticator({share_links.SOURCE: links, api_keys.SOURCE: keys}), events=parts)
    admin = {"authorization": f"Bearer {keys.add('admin', Scope.ADMIN)}"}
    secret = ask(app, "POST", "/api/v1/shares", headers=admin, json=limit).json()["secret"]
    for query in ("", "tags=a,b,c", "group=forklifts&group="):
        found = figures(app, query, headers={"authorization": f"Bearer {secret}"})
        assert [tag.tag for tag in found.tags] in (seen, [])
        assert {zone.zone for zone in found.zones} <= {"dock"}
        if query == "":
            assert [tag.tag for tag in found.tags] == seen
    assert ask(app, "GET", "/api/v1/figures").status_code == 401
