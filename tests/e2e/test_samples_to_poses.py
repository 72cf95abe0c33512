"""Samples go through a real service: poses come out over Zenoh and REST, and bad samples are counted."""

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.explain import Explanation
from dropanchor_schemas.pose import Pose, PoseFrame
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, encode_json, encode_packed
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client import TagClient
from support.ingest import IngestBench
from support.patience import PATIENCE_S
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import connected_session, wait_until

TAGS = ["a", "b", "Gabelstapler Süd"]


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return settings_file(tmp_path_factory.mktemp("service"), [*TAGS, "then"])


@pytest.fixture(scope="module")
def service(config: Path) -> Iterator[Running]:
    with running_service("--config", str(config)) as running:
        yield running


@pytest.fixture(scope="module")
def session(service: Running) -> Iterator[zenoh.Session]:
    with connected_session(service.zenoh) as opened:
        yield opened


def put(session: zenoh.Session, tag: str, frame: Frame) -> None:
    session.put(keys.samples_key("default", tag), encode_packed(frame), encoding=ENCODING_PACKED)


def send(client: TagClient, frame: Frame) -> None:
    for imu, heading, distance in zip(frame.imu, frame.headings, frame.ranges, strict=True):
        client.publish_imu(imu.acc, imu.gyro, imu.mag, t_ns=imu.t_ns)
        client.publish_heading(heading.heading_rad, t_ns=heading.t_ns, std_rad=heading.std_rad)
        client.publish_range("7", distance.range_m, t_ns=distance.t_ns, std_m=distance.std_m)
    client.flush()


def ask(session: zenoh.Session, key: str) -> dict[str, dict[str, object]]:
    """Send a query. Return the replies by key; an error has the key `error`."""
    replies = {}
    for reply in session.get(key, timeout=PATIENCE_S):
        if reply.ok is not None:
            replies[str(reply.ok.key_expr)] = json.loads(reply.ok.payload.to_string())
        elif reply.err is not None:
            replies["error"] = json.loads(reply.err.payload.to_string())
    return replies


def wait_for_service(session: zenoh.Session) -> None:
    """Wait for a reply of the service: then it knows what the session declared before."""
    assert ask(session, keys.anchor_key("default", "7"))


def samples_of(service: Running, tag: str) -> dict[str, int]:
    tags = {status["tag"]: status for status in service.get("/api/v1/tags")["tags"]}
    return dict(tags[tag]["samples"]) if tag in tags else {}


def rejected_of(service: Running, tag: str) -> dict[str, int]:
    tags = {status["tag"]: status for status in service.get("/api/v1/tags")["tags"]}
    return dict(tags[tag]["rejected"]) if tag in tags else {}


def offline(config: Path, tag: str, frame: Frame) -> list[float]:
    """Return x and y after these samples, from a service without threads and network."""
    settings = load_settings(config, environment={})
    bench = IngestBench(engine=create_engine(settings), site=settings.site, tags=settings.tags)
    bench.send(tag, frame)
    pose = bench.latest.row(bench.tags.register(tag).row)
    assert pose is not None
    return [float(pose["x"]), float(pose["y"])]


@pytest.mark.parametrize("encoding", ["packed", "json"])
def test_the_samples_of_a_client_give_the_same_pose_over_zenoh_and_rest(
    service: Running, session: zenoh.Session, config: Path, encoding: str
) -> None:
    tag = "a" if encoding == "packed" else "b"
    frame = straight_north(100)
    with TagClient(tag, connect=service.zenoh, encoding=encoding) as client:  # type: ignore[arg-type]
        send(client, frame)
        wait_until(lambda: samples_of(service, tag) == {"imu": 100, "heading": 100, "range": 100})
        pose = f"/api/v1/tags/{tag}/pose"
        wait_until(lambda: service.ask("GET", pose).json().get("t_ns") == frame.ranges[-1].t_ns)
        over_rest = Pose.model_validate(service.get(pose))
        over_zenoh = Pose.model_validate(ask(session, keys.pose_key("default", tag))[keys.pose_key("default", tag)])
    assert over_rest.t_ns == over_zenoh.t_ns == frame.ranges[-1].t_ns
    assert (over_rest.x, over_rest.y, over_rest.state) == (over_zenoh.x, over_zenoh.y, over_zenoh.state)
    assert [over_rest.x, over_rest.y] == pytest.approx(offline(config, tag, frame), abs=1e-3)  # float32 on the wire
    assert over_rest.y == pytest.approx(
        -10.1, abs=4.0
    )  # the IMU samples show no start of the motion, so the estimate lags
    assert over_rest.online
    assert over_rest.anchor == "7"


def test_one_query_with_wildcards_returns_many_tags_under_their_own_keys(
    service: Running, session: zenoh.Session
) -> None:
    for tag in TAGS:
        put(session, tag, straight_north(3))
    wait_until(lambda: len(service.get("/api/v1/poses")["poses"]) == len(TAGS))
    expected = {keys.pose_key("default", tag): tag for tag in TAGS}
    for key in (keys.all_tags("default", "pose"), f"{keys.PREFIX}/*/tag/*/pose", f"{keys.PREFIX}/**"):
        replies = ask(session, key)
        assert {name: reply["tag"] for name, reply in replies.items() if name in expected} == expected
    assert list(ask(session, f"{keys.PREFIX}/default/tag/a$*/pose")) == [keys.pose_key("default", "a")]


def test_samples_in_the_encoding_that_zenoh_pico_sends_are_used(service: Running, session: zenoh.Session) -> None:
    frame, encoding = straight_north(3), f"zenoh/bytes;{ENCODING_PACKED}"
    session.put(keys.samples_key("default", "pico"), encode_packed(frame), encoding=encoding)
    wait_until(lambda: samples_of(service, "pico") == {"imu": 3, "range": 3, "heading": 3})


def test_a_query_without_an_answer_gets_an_error_that_says_why(session: zenoh.Session) -> None:
    assert ask(session, keys.pose_key("default", "nobody")) == {"error": {"error": "tag 'nobody' is unknown"}}
    assert "anchor '99'" in str(ask(session, keys.anchor_key("default", "99"))["error"])
    assert "parameter 'when'" in str(ask(session, keys.pose_key("default", "a") + "?when=5")["error"])
    assert "parameter 'at': a time in ns" in str(ask(session, keys.pose_key("default", "a") + "?at=noon")["error"])
    in_seconds = ask(session, keys.pose_key("default", "a") + "?at=1800000000")["error"]
    assert "1800000000 looks like seconds: write it in ns" in str(in_seconds)


def test_the_pose_at_a_time_is_the_same_over_zenoh_and_rest_and_has_an_explanation(
    service: Running, session: zenoh.Session
) -> None:
    frame, key = straight_north(100), keys.pose_key("default", "then")
    frame = frame.replaced(imu=[])  # identical IMU samples would count as a frozen sensor
    put(session, "then", frame)
    newest_ns = frame.ranges[-1].t_ns
    wait_until(lambda: newest_ns in [pose["t_ns"] for pose in service.get("/api/v1/poses")["poses"]])
    explanation = Explanation.model_validate(service.get("/api/v1/tags/then/explain"))
    assert len(explanation.innovations) == 50
    assert explanation.innovations[-1].t_ns == newest_ns
    at_ns = newest_ns - 1_100_000_000
    over_rest = Pose.model_validate(service.get(f"/api/v1/tags/then/pose?at={at_ns}"))
    over_zenoh = Pose.model_validate(ask(session, f"{key}?at={at_ns}")[key])
    assert over_rest.t_ns == at_ns
    assert over_rest.model_copy(update={"age_s": 0.0}) == over_zenoh.model_copy(update={"age_s": 0.0})
    assert "ahead" in str(ask(session, f"{key}?at={newest_ns + 3_000_000_000}")["error"])
    assert ask(session, keys.all_tags("default", "pose") + f"?at={at_ns}")[key]["t_ns"] == at_ns
    assert ask(session, f"{key}?at={iso_utc(at_ns).lower()}")[key]["t_ns"] == at_ns


def test_an_anchor_can_be_queried(session: zenoh.Session) -> None:
    answer = ask(session, keys.anchor_key("default", "7"))[keys.anchor_key("default", "7")]
    assert (answer["id"], answer["x"], answer["y"], answer["z"]) == ("7", 0.0, 0.0, 0.0)
    assert list(ask(session, keys.all_anchors("default"))) == [keys.anchor_key("default", "7")]


def test_a_subscriber_to_a_tag_receives_the_poses_of_that_tag_only(service: Running, session: zenoh.Session) -> None:
    with connected_session(service.zenoh) as listener:
        found: list[tuple[str, Pose]] = []
        subscriber = listener.declare_subscriber(
            keys.pose_key("default", "b"),
            lambda message: found.append((str(message.key_expr), Pose.model_validate_json(message.payload.to_bytes()))),
        )
        wait_for_service(listener)
        frame = straight_north(2)
        put(session, "a", straight_north(2))
        put(session, "b", frame)
        # The previous pose may come first.
        wait_until(lambda: frame.ranges[-1].t_ns in [pose.t_ns for _, pose in found])
        subscriber.undeclare()
    assert {key for key, _ in found} == {keys.pose_key("default", "b")}


def test_frames_of_all_poses_come_at_most_ten_times_a_second(service: Running, session: zenoh.Session) -> None:
    with connected_session(service.zenoh) as listener:
        frames: list[PoseFrame] = []
        subscriber = listener.declare_subscriber(
            keys.poses_key("default"),
            lambda message: frames.append(PoseFrame.model_validate_json(message.payload.to_bytes())),
        )
        wait_for_service(listener)
        started = time.monotonic()

        def enough() -> bool:
            put(session, "a", straight_north(1))
            time.sleep(0.01)
            return len(frames) >= 3 and time.monotonic() - started > 1.5

        wait_until(enough)
        subscriber.undeclare()
        elapsed_s = time.monotonic() - started
    assert len(frames) <= 10.0 * elapsed_s + 2.0
    assert {*TAGS, "then", "pico"} >= set(frames[-1].tags) >= {"a"}


def test_a_tag_is_online_as_long_as_its_client_is_open(service: Running) -> None:
    def online() -> bool:
        return bool({tag["tag"]: tag["online"] for tag in service.get("/api/v1/tags")["tags"]}.get("visitor"))

    with TagClient("visitor", connect=service.zenoh):
        wait_until(online)
        assert service.metric("dropanchor_tags_online") >= 1
    wait_until(lambda: not online())


def test_the_service_itself_has_a_liveliness_token(session: zenoh.Session) -> None:
    tokens = [str(r.ok.key_expr) for r in session.liveliness().get(f"{keys.PREFIX}/default/service/*/alive") if r.ok]
    assert len(tokens) == 1


def test_garbage_is_counted_for_its_tag_and_the_service_goes_on(service: Running, session: zenoh.Session) -> None:
    key = keys.samples_key("default", "rogue")
    for payload, encoding in (
        (b"", ENCODING_PACKED),
        (b"\xff" * 100, ENCODING_PACKED),
        (encode_packed(straight_north(3))[:-1], ENCODING_PACKED),
        (b"null", ENCODING_JSON),
        (b'{"range":[{"t_ns":1,"anchor":7,"range_m":NaN}]}', ENCODING_JSON),
        (encode_json(straight_north(1)), "zenoh/bytes"),
    ):
        session.put(key, payload, encoding=encoding)
    session.put(f"{keys.PREFIX}/default/tag/%zz/samples", b"x", encoding=ENCODING_PACKED)
    before = samples_of(service, "b")["range"]
    put(session, "b", straight_north(2))
    wait_until(lambda: samples_of(service, "b")["range"] == before + 2)
    wait_until(lambda: sum(rejected_of(service, "rogue").values()) >= 6)
    rejected = rejected_of(service, "rogue")
    assert sum(rejected.values()) == 6
    assert rejected["payload_empty"] == rejected["length_mismatch"] == rejected["encoding_unknown"] == 1
    wait_until(lambda: service.metric('dropanchor_rejected_total{reason="key_invalid"}') == 1)
    assert service.process.poll() is None


def test_settings_given_over_rest_start_the_tag_afresh(service: Running, session: zenoh.Session) -> None:
    put(session, "late", straight_north(3))
    wait_until(lambda: service.ask("GET", "/api/v1/tags/late/pose").is_success)
    assert service.get("/api/v1/tags/late/pose")["state"] == "initialising"
    service.put("/api/v1/tags/late/settings", {"start": {"x": 10.0, "y": -20.0, "heading_rad": 1.5707963}})
    put(session, "late", straight_north(5))
    wait_until(lambda: service.get("/api/v1/tags/late/pose")["x"] is not None)
    assert service.get("/api/v1/tags/late/pose")["x"] == pytest.approx(10.0, abs=1.0)
