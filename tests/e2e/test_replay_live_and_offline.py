"""A recording replayed over Zenoh gives the poses of the same recording replayed offline."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.offline.replay import Samples, Track, anchors_of, replay, samples_of, track_of
from dropanchor_service.settings.engine_columns import tag_columns
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client.recording import read_recording
from support.patience import PATIENCE_S
from support.recordings import recording_or_skip, write_square
from support.service import environment, running_service
from support.zenoh_router import connected_session, wait_until

T0_NS = 1_760_000_000_000_000_000


def write_settings(folder: Path, engine: str, recording: Path, start: StartPose) -> Path:
    """Write the settings of a service with the anchors of the recording and the start of its tag."""
    anchors = [{"id": a.id, "x": a.x, "y": a.y, "z": a.z} for a in read_recording(recording).anchors]
    lines = [f"[[site.anchors]]\nid = {json.dumps(a['id'])}\nx = {a['x']}\ny = {a['y']}\nz = {a['z']}" for a in anchors]
    pose = f"{{ x = {start.x}, y = {start.y}, heading_rad = {start.heading_rad} }}"
    file = folder / "service.toml"
    file.write_text(f'engine = "{engine}"\n' + "\n".join(lines) + f"\n[tags.cart]\nstart = {pose}\n")
    return file


def offline(recording: Path, anchor: str, start: StartPose, config: Path) -> Track:
    """Return the track of an offline replay."""
    contents = read_recording(recording)
    settings = tag_columns(TagSettings(start=start), 0.0)
    engine = create_engine(load_settings(config, environment={}))
    samples = as_on_the_wire(samples_of(contents, [anchor]))
    return track_of([poses for _, poses in replay(engine, anchors_of(contents), settings, samples)])


def as_on_the_wire(samples: Samples) -> Samples:
    """Round values to single precision and times to microseconds, as messages do.

    A mixture drops its lightest hypotheses, so that a difference in the last digits would grow.
    """
    for columns in (samples.batch.imu, samples.batch.ranges, samples.batch.headings):
        columns["t_ns"] = np.round(columns["t_ns"] / 1000) * 1000
        for name in set(columns.dtype.names or ()) - {"row", "t_ns", "anchor"}:
            columns[name] = columns[name].astype(np.float32)
    return samples


def live(recording: Path, anchor: str, config: Path, last_ns: int) -> dict[int, tuple[float, float]]:
    """Publish the recording at 50 times its speed. Return x and y of every pose that a subscriber received, by time."""
    seen: dict[int, tuple[float, float]] = {}

    def on_message(message: zenoh.Sample) -> None:
        pose = json.loads(message.payload.to_string())
        if pose["x"] is not None:
            seen[pose["t_ns"]] = (pose["x"], pose["y"])

    with running_service("--config", str(config)) as service, connected_session(service.zenoh) as session:
        session.declare_subscriber(keys.pose_key("default", "cart"), on_message)
        arguments = ["replay", str(recording), "--tag", "cart", "--anchor", anchor, "--speed", "50"]
        arguments += ["--t0-ns", str(T0_NS), "--connect", service.zenoh]
        tag = [sys.executable, "-m", "dropanchor_tag_client", *arguments]
        subprocess.run(tag, check=True, env=environment(), timeout=PATIENCE_S, capture_output=True)
        wait_until(lambda: last_ns in seen)
    return seen


@pytest.mark.parametrize("engine", ["fleet", "paper"])
@pytest.mark.parametrize("name", ["square", "tiers_B"])
def test_live_and_offline_poses_are_the_same(tmp_path: Path, name: str, engine: str) -> None:
    recording = write_square(tmp_path, range_std_m=0.05) if name == "square" else recording_or_skip(name)
    anchor = "A" if name == "square" else "L0"
    start = StartPose(x=10, y=0, heading_rad=1.5708)
    if name == "tiers_B":
        start = StartPose(x=1.3836, y=1.3673, heading_rad=-2.2287)
    config = write_settings(tmp_path, engine, recording, start)
    track = offline(recording, anchor, start, config)
    expected = {T0_NS + int(p["t_ns"]): (float(p["x"]), float(p["y"])) for p in track.poses}
    seen = live(recording, anchor, config, T0_NS + int(track.poses["t_ns"][-1]))
    assert len(seen) >= 10
    assert set(seen) <= set(expected)
    # published poses have six decimals
    np.testing.assert_allclose([seen[t] for t in seen], [expected[t] for t in seen], rtol=0, atol=0.51e-6)
