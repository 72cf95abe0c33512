"""One tag that knows where it started tells all others of its site where north is, once somebody accepts that."""

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, ImuSample, RangeSample, encode_packed
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from support.service import Running, S, running_service, settings_file
from support.zenoh_router import wait_until

OFF = 2.2  # rad, of the site's axes
PIECE_S, LAST_S = 2.0, 44.0
ANCHOR = 7


@cache
def drive() -> Simulation:
    """Return a tag's drive in a room where the field points elsewhere."""
    models = preset("calibrated", imu_hz=50.0)
    return simulate("S5", 5000, replace(models, imu=replace(models.imu, declination_rad=OFF)))


def pieces(began_ns: int, from_s: float, to_s: float) -> Iterator[Frame]:
    """Yield the samples of this part of the drive, which began then."""
    run = drive()
    ns = [began_ns + round(t * S) for t in run.imu.t_s]
    while from_s < to_s:
        end = from_s + PIECE_S
        yield Frame(
            imu=[
                ImuSample(ns[i], tuple(run.imu.acc[i]), tuple(run.imu.gyro[i]), tuple(run.imu.mag[i]))
                for i, t in enumerate(run.imu.t_s)
                if from_s <= t < end
            ],
            ranges=[
                RangeSample(began_ns + round(t * S), ANCHOR, float(z), 0.1)
                for t, z in zip(run.ranges.t_s, run.ranges.range_m, strict=True)
                if from_s <= t < end
            ],
        )
        from_s = end


def send(service: Running, tag: str, frames: Iterator[Frame]) -> None:
    """Send samples, and wait until the pose of the tag is that of the last one."""
    for frame in frames:
        service.ask(
            "POST",
            f"/api/v1/ingest/samples?tag={tag}",
            content=encode_packed(frame),
            headers={"content-type": ENCODING_PACKED},
        ).raise_for_status()
    wait_until(lambda: frame.ranges[-1].t_ns <= service.ask("GET", f"/api/v1/tags/{tag}/pose").json().get("t_ns", 0))


def error_m(service: Running, tag: str, at_s: float) -> float:
    """Return how far the last pose is from where the tag was, m."""
    pose, truth = service.get(f"/api/v1/tags/{tag}/pose"), drive().truth
    last = int(abs(truth.t_s - at_s).argmin())
    return float(math.hypot(pose["x"] - truth.x[last], pose["y"] - truth.y[last]))


def test_north_of_one_tag_is_offered_to_all_and_applied_by_a_change_of_the_site(tmp_path: Path) -> None:
    truth = drive().truth
    start = {"x": truth.x[0], "y": truth.y[0], "heading_rad": math.remainder(truth.heading[0], math.tau)}
    own = {"height_m": float(truth.z[0]), "magnetometer_calibrated": True}
    began_ns = time.time_ns() - 150 * S
    with running_service("--config", str(settings_file(tmp_path, [])), "--data-dir", str(tmp_path / "data")) as service:
        service.put("/api/v1/tags/known/settings", own | {"start": start})
        service.put("/api/v1/tags/other/settings", own)
        assert service.get("/api/v1/site/north") == nothing()
        for tag in ("known", "other"):
            send(service, tag, pieces(began_ns, 0.0, LAST_S))
        rest = pieces(began_ns, LAST_S, 50.0)
        wait_until(lambda: is_offered(service, rest))
        offer = service.get("/api/v1/site/north")
        assert [one["tag"] for one in offer["tags"]] == ["known"]
        assert abs(math.remainder(offer["learned_rad"] - OFF, math.tau)) < 2.0 * offer["std_rad"]
        told = service.get("/api/v1/tags/other/explain")
        assert "Apply that to all." in told["uncertainty"]["text"]
        assert service.get("/api/v1/tags/known/explain")["north"]["std_rad"] < 0.3
        assert told["north"] is None
        lost_m, known = error_m(service, "other", LAST_S), service.get("/api/v1/tags/known/pose")

        site = service.get("/api/v1/site")
        learned = {"declination_rad": offer["learned_rad"], "declination_std_rad": offer["std_rad"]}
        service.put("/api/v1/site", site | learned)
        assert not service.get("/api/v1/site/north")["offered"]
        send(service, "other", pieces(began_ns + 70 * S, 0.0, LAST_S))
        assert error_m(service, "other", LAST_S) < 0.3 * lost_m
        after = service.get("/api/v1/tags/known/pose")
        assert (after["x"], after["y"], after["t_ns"]) == (known["x"], known["y"], known["t_ns"])
        service.put("/api/v1/site", site)
        assert service.get("/api/v1/site/north")["offered"]


def is_offered(service: Running, rest: Iterator[Frame]) -> bool:
    """Send the next samples of the tag that knows, and return whether north is offered."""
    time.sleep(1.1)  # the engine is asked once a second, with samples
    piece = next(rest, None)
    if piece is not None:
        send(service, "known", iter([piece]))
    return bool(service.get("/api/v1/site/north")["offered"])


def nothing() -> dict[str, Any]:
    empty = dict.fromkeys(("learned_rad", "std_rad", "phrase"))
    return empty | {"declination_rad": 0.0, "tags": [], "offered": False, "text": ""}
