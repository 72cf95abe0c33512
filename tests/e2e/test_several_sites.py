"""One service serves several sites: over Zenoh and REST, through a kill, and beside sites that it does not serve."""

import json
import signal
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import Frame
from dropanchor_tag_client import TagClient
from support.patience import PATIENCE_S
from support.service import Running, running_service, straight_north
from support.zenoh_router import connected_session, wait_until

RANGES, BEFORE = 60, 40
ALL = slice(None)
NORTH = """
[sites.north.site]
anchors = [{ id = "7" }]
[sites.north.tags.cart]
start = { x = 10.0, y = -20.0, heading_rad = 1.5707963 }
"""
SOUTH = """
[sites.south.site]
anchors = [{ id = "6" }, { id = "7", x = 100.0, y = 50.0 }]
[sites.south.tags.cart]
start = { x = 110.0, y = 30.0, heading_rad = 1.5707963 }
"""
WEST = """
[sites.west.site]
anchors = [{ id = "7" }]
"""


def publish(client: TagClient, frame: Frame, part: slice) -> None:
    for imu, heading, distance in zip(frame.imu[part], frame.headings[part], frame.ranges[part], strict=True):
        client.publish_imu(imu.acc, imu.gyro, imu.mag, t_ns=imu.t_ns)
        client.publish_heading(heading.heading_rad, t_ns=heading.t_ns, std_rad=heading.std_rad)
        client.publish_range("7", distance.range_m, t_ns=distance.t_ns, std_m=distance.std_m)
    client.flush()


def wait_for_ranges(service: Running, frame: Frame, count: int) -> None:
    """Wait until both sites have used the first ranges of the frame."""

    def have_arrived(site: str) -> bool:
        cart = f"/api/v1/sites/{site}/tags/cart"
        pose = service.ask("GET", f"{cart}/pose").json()
        if pose.get("t_ns") != frame.ranges[count - 1].t_ns:
            return False
        return bool(service.get(cart)["samples"]["range"] == count)

    wait_until(lambda: all(map(have_arrived, ("north", "south"))))


def kill(service: Running) -> None:
    """Kill the service after its next checkpoint."""
    now_s = time.monotonic()
    wait_until(lambda: time.monotonic() - service.metric("dropanchor_checkpoint_age_seconds") > now_s + 0.1)
    service.stop(signal.SIGKILL)


def place(pose: dict[str, Any]) -> tuple[float, float]:
    return pose["x"], pose["y"]


def ask(session: zenoh.Session, key: str) -> dict[str, Any]:
    replies = [reply.ok for reply in session.get(key, timeout=PATIENCE_S)]
    return {str(reply.key_expr): json.loads(reply.payload.to_string()) for reply in replies if reply is not None}


def test_two_sites_with_equal_names_are_served_apart_and_go_on_after_a_kill(
    tmp_path: Path, router_endpoint: str
) -> None:
    config = tmp_path / "sites.toml"
    config.write_text(NORTH + SOUTH)
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", router_endpoint)
    frame = straight_north(RANGES)
    with ExitStack() as opened:
        session = opened.enter_context(connected_session(router_endpoint))
        clients = [
            opened.enter_context(TagClient("cart", site=site, connect=router_endpoint))
            for site in ("north", "south", "west")
        ]
        received: list[str] = []
        with running_service(*options) as service:
            for wanted in (keys.poses_key("south"), keys.all_tags("north", "pose")):
                opened.enter_context(session.declare_subscriber(wanted, lambda put: received.append(str(put.key_expr))))
            for client in clients:
                publish(client, frame, slice(BEFORE))
            wait_for_ranges(service, frame, BEFORE)
            _check_answers(service, session)
            publish(clients[0], frame, slice(BEFORE, BEFORE + 10))
            publish(clients[1], frame, slice(BEFORE, BEFORE + 10))
            wait_until(lambda: {keys.poses_key("south"), keys.pose_key("north", "cart")} == set(received))
            _check_tracks(service)
            kill(service)
        for client in clients:
            publish(client, frame, slice(BEFORE + 10, None))
        with running_service(*options) as service:
            assert any("going on from a checkpoint with 2 tags" in line for line in service.log)
            wait_for_ranges(service, frame, RANGES)
            _check_answers(service, session)
            _check_events(service, session, router_endpoint)
            assert service.stop() == 0
    assert (tmp_path / "data" / "sites" / "south" / "events.sqlite").exists()
    assert not (tmp_path / "data" / "sites" / "north" / "events.sqlite").exists()


def test_a_site_that_leaves_and_one_that_comes_keep_the_tracks_of_the_others_through_kills(
    tmp_path: Path, router_endpoint: str
) -> None:
    config, frame = tmp_path / "sites.toml", straight_north(RANGES)
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", router_endpoint)
    poses: dict[str, dict[str, Any]] = {}
    for sites in ((NORTH, SOUTH), (WEST, NORTH), (NORTH, SOUTH, WEST)):
        config.write_text("".join(sites))
        with running_service(*options) as service:
            served = [site["site"] for site in service.get("/api/v1/sites")["sites"]]
            if not poses:
                with ExitStack() as opened:
                    for site in served:
                        publish(opened.enter_context(TagClient("cart", site=site, connect=router_endpoint)), frame, ALL)
                    wait_for_ranges(service, frame, RANGES)
                poses = {site: service.get(f"/api/v1/sites/{site}/tags/cart/pose") for site in served}
            else:
                assert any("going on from a checkpoint" in line for line in service.log)
            for site in poses.keys() & set(served):
                tag = service.get(f"/api/v1/sites/{site}/tags/cart")
                assert tag["samples"]["range"] == RANGES
            north = service.get("/api/v1/sites/north/tags/cart/pose")
            assert (place(north), north["t_ns"]) == (place(poses["north"]), poses["north"]["t_ns"])
            with TagClient("mark", site="north", connect=router_endpoint) as mark:  # only messages make checkpoints
                publish(mark, frame, slice(1))
            kill(service)


def _check_tracks(service: Running) -> None:
    """Check that each site has a history of its own tag, 100 m and 50 m apart."""

    def first(site: str) -> tuple[float, float] | None:
        t_ns = service.get(f"/api/v1/sites/{site}/tags/cart/pose")["t_ns"]
        period = f"from={t_ns - 60 * 10**9}&to={t_ns}"
        response = service.ask("GET", f"/api/v1/sites/{site}/tags/cart/track?{period}&limit=1")
        poses = response.json()["poses"] if response.is_success else []  # refused until the first poses are written
        return place(poses[0]) if poses else None

    wait_until(lambda: first("north") is not None and first("south") is not None)
    x, y = first("north") or (0.0, 0.0)
    assert first("south") == pytest.approx((x + 100.0, y + 50.0), abs=1e-3)


def _check_events(service: Running, session: zenoh.Session, endpoint: str) -> None:
    """Check that a tag which enters a zone of the south makes an event there, over REST and Zenoh, and no other."""
    received: list[tuple[str, str]] = []

    def take(put: zenoh.Sample) -> None:
        received.append((str(put.key_expr), json.loads(put.payload.to_string())["source"]))

    base = "/api/v1/sites/south"
    zone = {"id": "dock", "shape": {"type": "circle", "x": 110.0, "y": 30.0, "radius_m": 40.0}, "delay_s": 0.0}
    start = {"start": {"x": 110.0, "y": 30.0, "heading_rad": 1.5707963}}
    for path, body in (("zones/dock", zone), ("tags/lift/settings", start)):
        assert service.ask("PUT", f"{base}/{path}", json=body).status_code == 200
    with (
        session.declare_subscriber(f"{keys.PREFIX}/*/tag/*/event", take),
        TagClient("lift", site="south", connect=endpoint) as lift,
    ):
        drive = straight_north(80)  # long enough for ranges to confirm the start
        for heading, distance in zip(drive.headings, drive.ranges, strict=True):
            lift.publish_heading(heading.heading_rad, t_ns=heading.t_ns, std_rad=heading.std_rad)
            lift.publish_range("7", distance.range_m, t_ns=distance.t_ns, std_m=distance.std_m)
        lift.flush()
        wait_until(lambda: received == [(keys.event_key("south", "lift"), "urn:dropanchor:site:south")])
    (event,) = service.get(f"{base}/events")["events"]
    assert (event["type"], event["subject"]) == ("dropanchor.zone.enter", "lift")
    assert service.get("/api/v1/sites/north/events")["events"] == []


def _check_answers(service: Running, session: zenoh.Session) -> None:
    """Check that both sites have the same track, 100 m and 50 m apart, by REST and by Zenoh."""
    poses = {site: service.get(f"/api/v1/sites/{site}/tags/cart/pose") for site in ("north", "south")}
    x, y = place(poses["north"])
    assert place(poses["south"]) == pytest.approx((x + 100.0, y + 50.0), abs=1e-4)
    assert [pose["anchor"] for pose in poses.values()] == ["7", "7"]
    replies = ask(session, f"{keys.PREFIX}/*/tag/*/pose")
    assert replies.keys() == {keys.pose_key(site, "cart") for site in poses}
    for site, pose in poses.items():
        assert place(replies[keys.pose_key(site, "cart")]) == pytest.approx(place(pose), abs=1e-4)
    assert ask(session, keys.pose_key("south", "cart")).keys() == {keys.pose_key("south", "cart")}
    assert ask(session, keys.pose_key("west", "cart")) == {}
    assert ask(session, keys.anchor_key("south", "7"))[keys.anchor_key("south", "7")]["x"] == 100.0
    wait_until(lambda: [one["online"] for one in service.get("/api/v1/sites")["sites"]] == [1, 1])
    assert [(one["site"], one["tags"]) for one in service.get("/api/v1/sites")["sites"]] == [("north", 1), ("south", 1)]
    assert service.ask("GET", "/api/v1/poses").status_code == 404
    assert service.metric('dropanchor_rejected_total{reason="key_invalid"}') == 0
