"""The heat map over REST: cells with seconds, what is left out, and who may see it."""

from pathlib import Path

import pytest

from dropanchor_schemas.heat_map import HeatMap
from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import State
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from service.api.routes.test_track import RETENTION, SECOND
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench

MINUTES = 2


@pytest.fixture
def bench(tmp_path: Path) -> ApiBench:
    """Two tags that stand for two minutes, one of them in a group and ambiguous for 30 s of it."""
    made = make_api_bench(folder=tmp_path, retention=RETENTION)
    for second in range(0, 60 * MINUTES + 1, 5):
        t_ns = T_NS - (60 * MINUTES - second) * SECOND
        made.move("a", x=1.2, y=-3.4, t_ns=t_ns)
        made.move("b", x=9.0, y=0.1, t_ns=t_ns, state=State.AMBIGUOUS if second < 30 else State.TRACKING)
    made.write_history()
    made.answers.site.set_tag("b", TagSettings(group="forklifts"))
    return made


def heat_map(bench: ApiBench, query: str = "") -> HeatMap:
    response = ask(bench.app(), "GET", f"/api/v1/heat-map?{query}")
    assert response.status_code == 200, response.text
    return HeatMap.model_validate(response.json())


def test_cells_have_seconds_and_the_rest_is_left_out(bench: ApiBench) -> None:
    found = heat_map(bench)
    assert (found.tags, found.cell_m, found.placed_s, found.left_out_s) == (2, 1.0, 210, 30)
    cells = found.cells
    assert sorted(zip(cells.x, cells.y, cells.seconds, strict=True)) == [(1.5, -3.5, 120), (9.5, 0.5, 90)]


def test_tags_groups_a_period_and_the_size_of_a_cell_can_be_chosen(bench: ApiBench) -> None:
    assert heat_map(bench, "tags=a,x").cells.seconds == [120]
    assert heat_map(bench, "group=forklifts").cells.seconds == [90]
    assert heat_map(bench, "group=").cells.seconds == [120]
    assert heat_map(bench, "group=forklifts&tags=a").tags == 0
    assert heat_map(bench, f"from={T_NS - 60 * SECOND}&to={T_NS - 30 * SECOND}&tags=a").cells.seconds == [30]
    assert heat_map(bench, "cell_m=3").cell_m == 4
    assert heat_map(bench, "cell_m=64").cells.seconds == [120, 90]  # an edge lies between them
    assert heat_map(bench, "from=0&to=1").cells.seconds == []


@pytest.mark.parametrize(
    "query", ["cell_m=0.4", "cell_m=2000", "from=2&to=1", "from=0", "points=3", "tags=", "cell_m=nan"]
)
def test_invalid_parameters_are_refused(bench: ApiBench, query: str) -> None:
    assert kind_of(ask(bench.app(), "GET", f"/api/v1/heat-map?{query}")) == "invalid-request"


@pytest.mark.parametrize(("limit", "seconds"), [({"tag": "a"}, [120]), ({"group": "forklifts"}, [90])])
def test_a_share_link_shows_the_heat_of_its_tags_however_one_asks(
    bench: ApiBench, tmp_path: Path, limit: dict[str, str], seconds: list[float]
) -> None:
    links, keys = ShareLinks(tmp_path), ApiKeys(tmp_path)
    app = bench.app(authenticator=Authenticator({share_links.SOURCE: links, api_keys.SOURCE: keys}))
    admin = {"authorization": f"Bearer {keys.add('admin', Scope.ADMIN)}"}
    secret = ask(app, "POST", "/api/v1/shares", headers=admin, json=limit).json()["secret"]
    for query in ("", "?tags=a,b", "?group=forklifts&group="):
        path = f"/api/v1/heat-map{query}"
        found = ask(app, "GET", path, headers={"authorization": f"Bearer {secret}"}).json()["cells"]["seconds"]
        assert found in (seconds, [])
        if query == "":
            assert found == seconds
    assert ask(app, "GET", "/api/v1/heat-map").status_code == 401
