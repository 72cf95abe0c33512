"""The WebSocket of the omlox interface, over a real server."""

import time
from collections.abc import Iterator
from itertools import islice
from typing import Any

import pytest

from dropanchor_schemas.zones import EventType, TooCloseRule
from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.omlox.feed.topics import TOPICS
from dropanchor_service.api.omlox.models import FeatureCollection, FenceEvent, Location, TrackableMotion
from dropanchor_service.estimation.columns import Frame, State
from dropanchor_service.events.drafts import Draft
from support.events import circle
from support.omlox import BARE, OmloxBench, Socket, socket_to
from support.patience import PATIENCE_S


@pytest.fixture
def bench() -> OmloxBench:
    return OmloxBench()


@pytest.fixture
def socket(bench: OmloxBench) -> Iterator[Socket]:
    with bench.running() as port, socket_to(port) as connected:
        yield connected


def happen(bench: OmloxBench, *tags: str, kind: EventType = EventType.ZONE_ENTER, **data: Any) -> None:
    values = {"t_ns": 5_000_000, "since_ns": 4_000_000, "zone": "dock", "probability": 0.95, **data}
    bench.zones.store.commit([Draft(kind, tag, values) for tag in tags], {})


def test_a_subscription_brings_each_new_location_as_an_object(bench: OmloxBench, socket: Socket) -> None:
    bench.poses.move("tag-1", x=1.0)
    number = socket.subscribe("location_updates", crs="local")
    bench.poses.move("tag-2", x=2.0)
    message = socket.next()
    assert number > 0
    assert set(message) == {"event", "topic", "payload"}  # clients that find a number in it lose the message
    assert (message["event"], message["topic"]) == ("message", "location_updates")
    (location,) = message["payload"]
    Location.model_validate(location)
    assert (location["provider_id"], location["position"]["coordinates"]) == ("tag-2", [2.0, 0.0, 0.0])


def test_a_place_that_is_not_known_is_never_sent(bench: OmloxBench, socket: Socket) -> None:
    socket.subscribe("location_updates")
    socket.subscribe("trackable_motions")
    poses: dict[str, dict[str, Any]] = {
        "ambiguous": {"state": State.AMBIGUOUS},
        "lost": {"state": State.LOST},
        "turned": {"frame": Frame.RELATIVE},
        "nowhere": {"x": float("nan")},
    }
    for name, fields in poses.items():
        bench.poses.move(name, **fields)
    bench.poses.move("known")
    found = [socket.next()["payload"] for _ in range(2)]
    assert [one.get("provider_id") or one["location"]["provider_id"] for payload in found for one in payload] == [
        "known",
        "known",
    ]


@pytest.mark.parametrize("version", ["v2", "v1"])
def test_motions_and_geojson_have_their_own_topics(bench: OmloxBench, version: str) -> None:
    with bench.running() as port, socket_to(port, version) as socket:
        for topic in ("trackable_motions", "trackable_motions:geojson", "location_updates:geojson"):
            socket.subscribe(topic)
        bench.poses.move("tag-1", x=2.0)
        found = {message["topic"]: message["payload"] for message in (socket.next() for _ in range(3))}
    TrackableMotion.model_validate(found["trackable_motions"][0])
    assert found["trackable_motions"][0]["id"] == bench.id_of("tag-1")
    for topic in ("trackable_motions:geojson", "location_updates:geojson"):
        (collection,) = found[topic]
        (feature,) = FeatureCollection.model_validate(collection).features
        assert feature.geometry is not None
        assert feature.geometry.coordinates == pytest.approx([13.4, 52.5], abs=1e-3)


def test_parameters_select_what_is_sent(bench: OmloxBench, socket: Socket) -> None:
    bench.poses.move("tag-1", "tag-2")
    second = bench.id_of("tag-2")
    subscriptions: dict[str, dict[str, Any]] = {
        "location_updates": {"provider_id": ["TAG-2", "x"], "provider_type": "uwb", "source": "17", "accuracy": "0.6"},
        "trackable_motions": {"id": second.upper()},
    }
    for topic, params in subscriptions.items():
        socket.subscribe(topic, **params)
    socket.subscribe("location_updates", accuracy=0.1)
    socket.subscribe("location_updates", floor=3)
    socket.subscribe("location_updates", source="18")
    bench.poses.move("tag-1", "tag-2", "tag-3")
    found = [socket.next() for _ in range(2)]
    assert [message["topic"] for message in found] == ["location_updates", "trackable_motions"]
    assert [[one["trackables"][0] for one in found[0]["payload"]], [one["id"] for one in found[1]["payload"]]] == [
        [second],
        [second],
    ]
    happen(bench, "tag-9")
    with pytest.raises(TimeoutError):
        socket.next(0.5)


def test_entries_and_exits_are_sent_in_order_and_can_be_selected(bench: OmloxBench, socket: Socket) -> None:
    bench.zones.put(circle("dock"), circle("gate"))
    dock, gate = bench.get("fences")
    happen(bench, "earlier")
    socket.subscribe("fence_events", fence_id=dock)
    socket.subscribe("fence_events", event_type="region_exit", trackable_id=bench_id(bench, "tag-2"))
    socket.subscribe("fence_events", provider_id="tag-3")
    happen(bench, "tag-1")
    happen(bench, "tag-2", kind=EventType.ZONE_EXIT, zone="gate")
    happen(bench, "tag-3", zone="gate")
    first, second, third = (FenceEvent.model_validate(socket.next()["payload"][0]) for _ in range(3))
    assert [str(event.fence_id) for event in (first, second, third)] == [dock, gate, gate]
    assert (first.event_type, first.entry_time) == ("region_entry", "1970-01-01T00:00:00.004Z")
    assert (second.event_type, second.exit_time) == ("region_exit", "1970-01-01T00:00:00.005Z")
    assert str(third.trackable_id) == bench_id(bench, "tag-3")
    assert third.provider_id is None


def test_an_event_that_is_stored_while_others_are_read_is_sent_once(
    bench: OmloxBench, socket: Socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = bench.zones.store.after
    tags = iter(["tag-2"])

    def read_late(*arguments: Any) -> Any:
        happen(bench, *islice(tags, 1))
        return read(*arguments)

    socket.subscribe("fence_events")
    monkeypatch.setattr(bench.zones.store, "after", read_late)
    happen(bench, "tag-1")
    assert len(socket.next()["payload"]) == 2
    happen(bench, "tag-3")
    (event,) = socket.next()["payload"]
    assert event["trackable_id"] == bench_id(bench, "tag-3")


def test_fence_events_as_geojson_have_the_shape_of_the_fence(bench: OmloxBench, socket: Socket) -> None:
    bench.zones.put(circle("dock"))
    socket.subscribe("fence_events:geojson")
    happen(bench, "tag-1")
    (feature,) = FeatureCollection.model_validate(socket.next()["payload"][0]).features
    assert feature.geometry is not None
    assert feature.properties["event_type"] == "region_entry"
    assert feature.properties["radius"] == 5.0
    happen(bench, "tag-1", zone="deleted")
    (feature,) = FeatureCollection.model_validate(socket.next()["payload"][0]).features
    assert feature.geometry is None


def test_tags_that_come_too_close_are_a_collision(bench: OmloxBench, socket: Socket) -> None:
    rule = TooCloseRule(id="apart", type="too_close", distance_m=3.0)
    bench.zones.put(rules=[rule])
    socket.subscribe("collision_events")
    bench.zones.stay(2.0, "tag-1", "tag-2", x=1.0)
    (collision,) = socket.next()["payload"]
    assert collision["collision_type"] == "collision_start"
    assert [one["id"] for one in collision["collisions"]] == [bench.id_of("tag-1"), bench.id_of("tag-2")]


def test_every_topic_can_be_subscribed_and_ended(bench: OmloxBench, socket: Socket) -> None:
    numbers = {topic: socket.subscribe(topic) for topic in TOPICS}
    assert len(set(numbers.values())) == len(TOPICS)
    for topic, number in numbers.items():
        answer = socket.ask(event="unsubscribe", subscription_id=number)
        assert answer == {"event": "unsubscribed", "topic": topic, "subscription_id": number}
    bench.poses.move("tag-1")
    happen(bench, "tag-1")
    assert socket.ask(event="unsubscribe", subscription_id=1)["code"] == 10003


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ({"event": "dance"}, 10000),
        ({"event": "subscribe", "topic": "weather"}, 10001),
        ({"event": "subscribe"}, 10001),
        ({"event": "subscribe", "topic": "location_updates", "params": {"crs": "EPSG:3857"}}, 10002),
        ({"event": "subscribe", "topic": "location_updates", "params": {"surprise": 1}}, 10002),
        ({"event": "subscribe", "topic": "location_updates", "params": {"zone_id": "nowhere"}}, 10002),
        ({"event": "subscribe", "topic": "location_updates:geojson", "params": {"crs": "local"}}, 10002),
        ({"event": "unsubscribe", "subscription_id": 99}, 10003),
        ({"event": "message", "topic": "location_updates", "payload": []}, 10004),
        ({"topic": "location_updates"}, 10005),
        ({"event": "subscribe", "topic": "location_updates", "params": []}, 10005),
    ],
)
def test_a_message_that_cannot_be_served_gets_its_code_and_the_connection_goes_on(
    socket: Socket, message: dict[str, Any], code: int
) -> None:
    answer = socket.ask(**message)
    assert (answer["event"], answer["code"]) == ("error", code)
    assert answer["description"]
    socket.subscribe("location_updates")


@pytest.mark.parametrize("data", ["{", "[]", "5", b"\x00"])
def test_what_is_not_a_message_is_invalid_data(socket: Socket, data: str | bytes) -> None:
    socket.connection.send(data)
    assert socket.next()["code"] == 10005


def test_degrees_need_a_georeference() -> None:
    bench = OmloxBench(BARE)
    with bench.running() as port, socket_to(port) as socket:
        assert socket.ask(event="subscribe", topic="location_updates:geojson")["code"] == 10002
        socket.subscribe("location_updates")
        bench.poses.move("tag-1")
        assert socket.next()["payload"][0]["crs"] == "local"


def test_a_new_georeference_counts_at_once_and_a_removed_one_ends_what_needs_it(
    bench: OmloxBench, socket: Socket
) -> None:
    socket.subscribe("location_updates", crs="EPSG:4326")
    store = bench.poses.answers.site
    assert store.site.georeference is not None
    moved = store.site.georeference.model_copy(update={"lat": -33.0})
    store.set_site(store.site.model_copy(update={"georeference": moved}))
    bench.poses.move("tag-1")
    assert socket.next()["payload"][0]["position"]["coordinates"][1] == pytest.approx(-33.0, abs=1e-3)
    store.set_site(store.site.model_copy(update={"georeference": None}))
    assert socket.next()["code"] == 10002
    bench.poses.move("tag-1")
    assert socket.ask(event="dance")["code"] == 10000


class Patient(GuardedProtocol):
    stalled_s = PATIENCE_S  # a client that does not read is not cut meanwhile


def test_a_client_that_does_not_read_misses_old_positions_and_no_event(bench: OmloxBench) -> None:
    tags, rounds = [f"tag-{index}" for index in range(300)], 60
    bench.zones.put(circle("dock"))
    with bench.running(Patient) as port, socket_to(port, max_queue=1) as socket:
        socket.subscribe("location_updates", crs="local")
        socket.subscribe("fence_events")
        for index in range(rounds):
            bench.poses.move(*tags, x=float(index))
            happen(bench, f"tag-{index}")
            time.sleep(0.02)  # the client does not read meanwhile
        latest: dict[str, float] = {}
        entered: list[str] = []
        positions = 0
        while set(latest.values()) != {float(rounds - 1)} or len(entered) < rounds:
            message = socket.next()
            for one in message["payload"]:
                if message["topic"] == "fence_events":
                    entered.append(one["properties"]["dropanchor"]["provider_id"])
                else:
                    positions += 1
                    assert latest.get(one["provider_id"], -1.0) <= one["position"]["coordinates"][0]
                    latest[one["provider_id"]] = one["position"]["coordinates"][0]
    assert len(latest) == len(tags)
    assert entered == [f"tag-{index}" for index in range(rounds)]
    assert positions < rounds * len(tags)


def bench_id(bench: OmloxBench, tag: str) -> str:
    """Return the id of the trackable of a tag, which may be new."""
    bench.poses.answers.tags.register(tag)
    return bench.id_of(tag)


def test_what_is_retracted_comes_as_its_opposite(bench: OmloxBench, socket: Socket) -> None:
    bench.zones.put(circle("dock"))
    socket.subscribe("fence_events")
    retracted = {"retracts": "5f0c1bb0c6a04f0f8f5a3c1a0c6d2e11", "reason": "start_denied"}
    for kind in (EventType.ZONE_DWELL, EventType.ZONE_ENTER):
        happen(bench, "a", kind=EventType.EVENT_RETRACTED, retracted_type=kind.value, **retracted)
    (event,) = socket.next()["payload"]
    assert event["event_type"] == "region_exit"
    assert event["properties"]["dropanchor"]["retracts"] == "5f0c1bb0-c6a0-4f0f-8f5a-3c1a0c6d2e11"
