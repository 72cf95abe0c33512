"""Lists and streams of selected poses: by state, place and text."""

from typing import Any

import pytest

from dropanchor_schemas.site import TagSettings
from dropanchor_service.answers.pose_filter import PoseFilter
from dropanchor_service.api.routes.stream import Changes
from dropanchor_service.estimation.columns import Frame, State
from support.api import ApiBench, ask, kind_of, make_api_bench


@pytest.fixture
def bench() -> ApiBench:
    bench = make_api_bench()
    bench.move("cart-1", x=1.0, y=1.0)
    bench.move("Cart-2", x=5.0, y=-2.5, state=State.DEGRADED)
    bench.answers.site.set_tag("cart-1", TagSettings(group="carts"))
    bench.move("a", "b", "a,b", x=50.0, state=State.COASTING)
    bench.move("drone", x=1.5, y=1.5, frame=Frame.RELATIVE)
    return bench


@pytest.mark.parametrize(
    ("query", "tags"),
    [
        ("state=tracking", ["cart-1"]),
        ("state=relative", ["drone"]),
        ("state=degraded&state=lost", ["Cart-2"]),
        ("state=lost", []),
        ("box=0,0,2,2", ["cart-1"]),
        ("box=-1,-3,6,1.0", ["cart-1", "Cart-2"]),
        ("text=CART", ["cart-1", "Cart-2"]),
        ("text=cart&state=tracking&box=0,0,2,2", ["cart-1"]),
        ("tags=drone,Cart-2&text=rt", ["Cart-2"]),
        ("state=degraded,lost", ["Cart-2"]),
        ("tags=a%2Cb&tags=drone", ["a,b", "drone"]),
        ("tags=a%2Cb&tags=a%2Cb", ["a,b"]),
        ("tags=a%2Cb", ["a", "b"]),
        ("tags=a,b,a", ["a", "b"]),
        ("group=carts", ["cart-1"]),
        ("group=carts&group=", ["cart-1", "Cart-2", "a", "b", "a,b", "drone"]),
        ("group=nobody", []),
    ],
)
def test_a_list_holds_the_tags_that_meet_every_condition(bench: ApiBench, query: str, tags: list[str]) -> None:
    answer = ask(bench.app(), "GET", f"/api/v1/poses?{query}").json()
    assert [pose["tag"] for pose in answer["poses"]] == tags


def test_a_state_is_that_of_the_answer_and_not_of_the_estimator(bench: ApiBench) -> None:
    bench.now_ns += 60_000_000_000
    assert len(ask(bench.app(), "GET", "/api/v1/poses?state=lost").json()["poses"]) == 6
    assert ask(bench.app(), "GET", "/api/v1/poses?state=tracking").json()["poses"] == []


@pytest.mark.parametrize(
    "query",
    [
        "state=fine",
        "state=lost,fine",
        "tags=a,&tags=",
        "tags=a,,b",
        "box=1,2,3",
        "box=a,b,c,d",
        "box=1,2,3,nan",
        "team=a",
    ],
)
def test_a_condition_that_cannot_be_understood_is_refused(bench: ApiBench, query: str) -> None:
    assert kind_of(ask(bench.app(), "GET", f"/api/v1/poses?{query}")) == "invalid-request"


def test_a_stream_tells_once_that_a_tag_has_left(bench: ApiBench) -> None:
    def tags(frame: Any) -> list[str]:
        return [] if frame is None else list(frame["tags"])

    changes = Changes(bench.answers, list, [], PoseFilter(box=(0.0, 0.0, 2.0, 2.0)))
    assert tags(changes.snapshot()) == ["cart-1"]
    bench.move("Cart-2", x=6.0, y=0.0)
    assert tags(changes.next()) == []
    bench.move("cart-1", x=3.0, y=1.0)
    bench.move("Cart-2", x=1.0, y=0.0)
    assert sorted(tags(changes.next())) == ["Cart-2", "cart-1"]
    bench.move("cart-1", x=3.5, y=1.0)
    assert tags(changes.next()) == []


def test_a_stream_tells_once_that_a_tag_is_in_another_state(bench: ApiBench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dropanchor_service.api.routes.stream.STATE_CHECK_S", 0.0)
    changes = Changes(bench.answers, list, [], PoseFilter(states=["tracking"]))
    assert list(changes.snapshot()["tags"]) == ["cart-1"]
    bench.now_ns += 60_000_000_000
    frame = changes.next()
    assert frame is not None
    assert list(zip(frame["tags"], frame["state"], strict=True)) == [("cart-1", "lost")]
    assert changes.next() is None
