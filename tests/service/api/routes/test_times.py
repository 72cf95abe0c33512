"""Times as people write them, where the interface takes or gives a time."""

from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

from dropanchor_schemas.times import ns_of_iso
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.history.storage import Retention
from support.api import T_NS, ask, kind_of, make_api_bench
from support.interface_document import DOCUMENT

T_UTC = "2027-01-15T08:00:00.000000000Z"


def test_a_time_is_written_as_it_is_read() -> None:
    assert iso_utc(T_NS) == T_UTC
    assert ns_of_iso(iso_utc(T_NS + 1)) == T_NS + 1


def test_a_pose_at_a_time_and_a_track_take_iso_times_and_give_them(tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path, retention=Retention(1, 0.0, 0, 10**18, 2**40))
    bench.move("a", x=1.0)
    bench.write_history()
    app = bench.app()
    assert ask(app, "GET", "/api/v1/tags/a/pose").json()["t_utc"] == T_UTC
    then = ask(app, "GET", "/api/v1/tags/a/pose?at=2027-01-15T08:00:01Z").json()
    assert (then["t_ns"], then["t_utc"]) == (T_NS + 10**9, "2027-01-15T08:00:01.000000000Z")
    window = f"from={quote('2027-01-15T08:59:00+01:00')}&to=2027-01-15T08:01Z"
    track = ask(app, "GET", f"/api/v1/tags/a/track?{window}").json()
    assert (track["from_ns"], track["to_ns"]) == (T_NS - 60 * 10**9, T_NS + 60 * 10**9)
    assert [pose["t_utc"] for pose in track["poses"]] == [T_UTC]
    unescaped = ask(app, "GET", "/api/v1/tags/a/track?from=2027-01-15T08:59:00+01:00&to=2027-01-15T08:01Z").json()
    assert unescaped["from_ns"] == track["from_ns"]
    assert "t_utc" in ask(app, "GET", f"/api/v1/tags/a/track?{window}&format=csv").text.splitlines()[0].split(",")


@pytest.mark.parametrize(
    "text", ["yesterday", "2027-01-15", "2027-01-15T08:00:00", "2027-02-30T08:00Z", "1969-01-01T00:00Z"]
)
def test_a_time_without_a_zone_or_that_does_not_exist_is_refused(text: str) -> None:
    bench = make_api_bench()
    bench.move("a")
    answer = ask(bench.app(), "GET", f"/api/v1/tags/a/pose?at={text}")
    assert kind_of(answer) == "invalid-request"
    assert "query.at" in answer.text


@pytest.mark.parametrize("since", ["2027-01-15T08:00:01Z", "2027-01-15t09:00:01+01:00", "2027-01-15T08:00:01z"])
def test_events_are_asked_for_from_an_iso_time_on(since: str) -> None:
    app = make_api_bench().app()
    assert ask(app, "GET", f"/api/v1/events?since={since}").json() == {"events": [], "next": None}
    assert "query.since" in ask(app, "GET", "/api/v1/events?since=yesterday").text


TIME_PARAMETERS = (
    [
        f"{path}?{name}="
        for path in (
            "tags/a/track",
            "tags/a/track/file",
            "tracks",
            "heat-map",
            "figures",
            "history/coverage",
            "audit",
            "audit/file",
        )
        for name in ("from", "to")
    ]
    + ["tags/a/pose?at="]
    + [f"{path}?{name}=" for path in ("events", "events/file") for name in ("since", "to")]
)

OF_THE_BLACK_BOX = ["tags/a/explain?at=", "tags/a/samples?from=", "tags/a/samples?to="]


@pytest.mark.parametrize("parameter", TIME_PARAMETERS + OF_THE_BLACK_BOX)
def test_every_time_parameter_takes_iso_and_refuses_other_units(parameter: str, tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path, retention=Retention(1, 0.0, 0, 10**18, 2**40))
    bench.move("a")
    app = bench.app()
    name = parameter.split("?")[1].rstrip("=")
    found = 409 if parameter in OF_THE_BLACK_BOX else 200  # which this service does not have
    assert ask(app, "GET", f"/api/v1/{parameter}2027-01-15t08:00:00z").status_code == found
    for unit_ns, unit in ((10**9, "seconds"), (10**6, "milliseconds"), (10**3, "microseconds")):
        answer = ask(app, "GET", f"/api/v1/{parameter}{T_NS // unit_ns}")
        assert kind_of(answer) == "invalid-request"
        assert f"query.{name}: {T_NS // unit_ns} looks like {unit}" in answer.json()["detail"]
        assert f"times {unit_ns}, or as 2027-01-15T08:00:00Z" in answer.json()["detail"]


def test_every_parameter_that_takes_a_time_is_tested_here() -> None:
    found = {
        f"{path.removeprefix('/api/v1/').replace('{tag}', 'a')}?{parameter['name']}="
        for path, item in DOCUMENT["paths"].items()
        for operation in item.values()
        for parameter in operation.get("parameters", [])
        if "date-time" in str(parameter["schema"])
    }
    assert {name for name in found if not name.startswith("sites/")} == set(TIME_PARAMETERS + OF_THE_BLACK_BOX)


def test_a_tag_was_heard_at_times_that_people_can_read() -> None:
    bench = make_api_bench()
    bench.answers.tags.register("a")
    status = ask(bench.app(), "GET", "/api/v1/tags/a").json()
    assert (status["first_heard_utc"], status["last_heard_utc"]) == (None, None)
    bench.answers.tags.rows.count_messages(np.array([0]), T_NS)
    status = ask(bench.app(), "GET", "/api/v1/tags/a").json()
    assert (status["first_heard_utc"], status["last_heard_utc"]) == (T_UTC, T_UTC)
