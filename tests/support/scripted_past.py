"""A data folder with a past that is scripted: what simulated tags sent, what somebody changed, and what went wrong."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from itertools import count
from math import inf
from pathlib import Path
from typing import NamedTuple

from dropanchor_schemas.wire import Frame, ImuSample, Vector, encode_packed
from dropanchor_service.blackbox.box import BlackBox
from dropanchor_service.blackbox.opened import box_folder
from dropanchor_service.blackbox.pieces import Limits
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.events.database import Database
from dropanchor_service.events.trail import ChangeTrail
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.persistence.site import Persistence, open_sites
from dropanchor_service.settings.sources import load_settings
from dropanchor_service.store import SiteStore
from dropanchor_tag_client.simulator.live import Delivery, deliveries, tag_name
from dropanchor_tag_client.simulator.ranging import AnchorPlace
from dropanchor_tag_client.simulator.sensors import preset
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import known_starts
from support.zenoh_router import wait_until

S = 1_000_000_000
TURN_S, JUMP_NS = 2.0, 60 * S
STEP_S, WRITE_S = 0.05, 10.0
MODELS = preset("calibrated")
LIMITS = Limits(2**40, 10**18)


class Script(NamedTuple):
    """What happens. Times: s since the beginning.

    turned: this tag is turned left by a quarter on its vehicle, whose mounting is told. jumped: the clock of this one
    is set back by a minute, both at `at_s`. anchor_x: the anchor is carried there at `moved_s`. changes: what somebody
    changes.
    """

    turned: str = ""
    jumped: str = ""
    at_s: float = inf
    anchor_x: float = 0.0
    moved_s: float = inf
    changes: Mapping[float, Callable[[SiteStore], None]] = {}

    def sent(self, here: Delivery, there: Delivery, t0_ns: int) -> Frame:
        """Return what a tag sends. here, there: what it measures with the anchor in its place, and carried away."""
        imu, ranges = here.imu, (here if here.due_s < self.moved_s else there).ranges
        if tag_name(here.tag) == self.turned:
            imu = [_turned(sample, (sample.t_ns - t0_ns) / S - self.at_s) for sample in imu]
        if tag_name(here.tag) == self.jumped and here.due_s >= self.at_s:
            imu = [sample._replace(t_ns=sample.t_ns - JUMP_NS) for sample in imu]
            ranges = [sample._replace(t_ns=sample.t_ns - JUMP_NS) for sample in ranges]
        return Frame(imu=imu, ranges=ranges)


def _turned(sample: ImuSample, since_s: float) -> ImuSample:
    """Return what an IMU measures whose body turns left by a quarter in two seconds."""
    angle = min(max(since_s / TURN_S, 0.0), 1.0) * math.pi / 2
    rate = math.pi / 2 / TURN_S if 0.0 < angle < math.pi / 2 else 0.0
    c, s = math.cos(angle), math.sin(angle)

    def seen(v: Vector) -> Vector:
        return (c * v[0] + s * v[1], -s * v[0] + c * v[1], v[2])

    x, y, z = seen(sample.gyro)
    return sample._replace(
        acc=seen(sample.acc), gyro=(x, y, z + rate), mag=None if sample.mag is None else seen(sample.mag)
    )


def write_past(folder: Path, tags: int, seed: int, t0_ns: int, seconds: float, script: Script) -> Path:
    """Write what a service leaves whose tags sent for some seconds from a time on. Return its settings file."""
    config = folder / "past.toml"
    config.write_text(_settings(tags, seed, script.turned))
    data = folder / "data"
    data.mkdir()
    settings, clock = load_settings(config, options={"data_dir": data}, environment={}), ManualClock(t0_ns)
    sites = open_sites(settings)
    site = sites[0]
    kept = Persistence(settings, site.tags, site.store, clock.now_ns)
    observers = Observers(lambda messages: box.on_messages(messages), kept.observers.poses)
    bench = IngestBench(engine=create_engine(settings), clock=clock, sites=sites, observers=observers)
    state = bench.service_state()
    of_runs, folder_of_box = settings.of_replays, box_folder(data, None)
    box = BlackBox(folder_of_box, LIMITS, sites, state, clock.now_ns, of_runs, lambda: clock.t_ns / S)
    with closing(Database(data)) as events, kept:
        site.store.trail = ChangeTrail(events, clock.now_ns)
        sent, left = _sent(tags, seed, t0_ns, script), sorted(script.changes.items())
        following = next(sent)
        for step in range(1, round(seconds / STEP_S) + 1):
            while following.due_s <= step * STEP_S:
                bench.put(following.tag, following.payload, at_ns=t0_ns + round(following.due_s * S))
                following = next(sent)
            clock.t_ns = t0_ns + round(step * STEP_S * S)
            while left and left[0][0] <= step * STEP_S:
                left.pop(0)[1](site.store)
            bench.ingest.turn()
            box.between_turns(bench.ingest.has_pending)
            if step % round(WRITE_S / STEP_S) == 0:
                assert box.writer.flush()
        assert box.writer.flush()
        assert kept.tracks is not None
        wait_until(lambda tracks=kept.tracks: tracks.writer.queued_bytes == 0)  # type: ignore[misc]
    CheckpointFolder(data / "checkpoints", state.layout, state.as_present).write(state.snapshot())
    return config


class _Sent(NamedTuple):
    due_s: float
    tag: str
    payload: bytes


def _sent(tags: int, seed: int, t0_ns: int, script: Script) -> Iterator[_Sent]:
    """Yield the messages of tags, each numbered by its own tag."""
    places = (0.0,) if script.moved_s == inf else (0.0, script.anchor_x)
    measured = [
        deliveries(tags, "yard", seed, replace(MODELS, anchors=(AnchorPlace(x=x),)), t0_ns, STEP_S * 2) for x in places
    ]
    numbers = [count() for _ in range(tags)]
    for at_once in zip(*measured, strict=True):
        here, there = at_once[0], at_once[-1]
        frame = script.sent(here, there, t0_ns).replaced(sequence=next(numbers[here.tag]), boot_id=here.tag + 1)
        yield _Sent(here.due_s, tag_name(here.tag), encode_packed(frame))


def _settings(tags: int, seed: int, turned: str) -> str:
    lines = ['engine = "fleet"', "[[site.anchors]]", 'id = "1"']
    for tag, settings in known_starts(tags, seed).items():
        start = ", ".join(f"{name} = {value}" for name, value in settings["start"].items())
        lines += [f"[tags.{json.dumps(tag)}]", f"start = {{ {start} }}", *["mount_angle_rad = 0.0"] * (tag == turned)]
    return "\n".join(lines) + "\n"
