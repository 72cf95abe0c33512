"""The stream of poses, from a real uvicorn on loopback."""

import time

import pytest

from dropanchor_schemas.pose import PoseFrame
from dropanchor_service.api.routes import stream
from support.api import kind_of, make_api_bench
from support.event_stream import get, serving, streaming


def test_a_stream_starts_with_all_tags_and_continues_with_changes() -> None:
    bench = make_api_bench()
    bench.move("a", "b", x=1.0)
    with serving(bench) as port, streaming(port) as events:
        name, frame = next(events)
        assert (name, frame["tags"], frame["x"]) == ("snapshot", ["a", "b"], [1.0, 1.0])
        PoseFrame.model_validate(frame)
        bench.move("b", x=2.0)
        name, frame = next(events)
        assert (name, frame["tags"], frame["x"]) == ("poses", ["b"], [2.0])
        bench.move("c", x=3.0)
        assert next(events)[1]["tags"] == ["c"]


def test_a_stream_without_poses_starts_with_an_empty_snapshot() -> None:
    with serving(make_api_bench()) as port, streaming(port) as events:
        name, frame = next(events)
        assert (name, frame["tags"]) == ("snapshot", [])


def test_a_stream_of_selected_tags_includes_those_that_appear_later() -> None:
    bench = make_api_bench()
    bench.move("a", "b")
    with serving(bench) as port, streaming(port, "max_hz=30&tags=b,late") as events:
        assert next(events)[1]["tags"] == ["b"]
        bench.move("a")
        bench.move("late")
        assert next(events)[1]["tags"] == ["late"]


def test_a_client_gets_the_newest_poses_at_no_more_than_its_rate() -> None:
    bench = make_api_bench()
    bench.move("a", x=0.0)
    with serving(bench) as port, streaming(port, "max_hz=5") as events:
        next(events)
        start_s = time.monotonic()
        seen: list[float] = []
        for count in range(1, 101):
            bench.move("a", x=float(count))
            time.sleep(0.01)
        while not seen or seen[-1] != 100.0:
            seen.append(next(events)[1]["x"][0])
        assert len(seen) <= (time.monotonic() - start_s) * 5 + 1
        assert seen == sorted(set(seen))


def test_a_tag_that_falls_silent_or_goes_offline_is_reported_without_a_new_pose() -> None:
    bench = make_api_bench()
    bench.move("a", "b")
    bench.answers.tags.presence.set_token("b", True)
    with serving(bench) as port, streaming(port) as events:
        assert next(events)[1]["online"] == [False, True]
        bench.answers.tags.presence.set_token("b", False)
        frame = next(events)[1]
        assert (frame["tags"], frame["online"]) == (["b"], [False])
        bench.now_ns += 2_000_000_000
        assert next(events)[1]["state"] == ["coasting", "coasting"]


def test_a_quiet_stream_sends_heartbeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "HEARTBEAT_S", 0.1)
    with serving(make_api_bench()) as port, streaming(port) as events:
        next(events)
        assert next(events) == ("", ": alive")


@pytest.mark.parametrize("query", ["max_hz=nan", "max_hz=inf", "max_hz=0.09", "max_hz=30.1", "max_hz=fast", "hz=1"])
def test_invalid_stream_parameters_are_a_problem(query: str) -> None:
    with serving(make_api_bench()) as port:
        assert kind_of(get(port, f"/api/v1/stream?{query}")) == "invalid-request"


def test_streams_end_when_the_server_stops() -> None:
    bench = make_api_bench()
    with serving(bench) as port, streaming(port, "max_hz=0.1") as events:
        next(events)
        bench.stopping.set()
        assert list(events) == []
