"""Measure how old a pose is when a Zenoh query returns it."""

import json
import time

import numpy as np
import zenoh

from benchmarks.generator import SLOTS
from benchmarks.motion import STEP_NS
from dropanchor_schemas.keys import pose_key
from support.zenoh_router import connected_session

POLL_S = 0.002
GIVE_UP_MS = 2000.0


def latencies_ms(endpoint: str, tags: int, start_ns: int, duration_s: float) -> list[float]:
    """Return, for one burst after another, the time from its newest sample to a reply with the pose of that sample.

    One tag of the burst is queried until its pose has the time of the newest sample.
    """
    found: list[float] = []
    rng = np.random.default_rng(0)
    end_s = time.monotonic() + duration_s
    with connected_session(endpoint) as session:
        while time.monotonic() < end_s:
            burst = (time.time_ns() - start_ns) * SLOTS // STEP_NS + 2
            due_ns = start_ns + burst // SLOTS * STEP_NS + burst % SLOTS * STEP_NS // SLOTS
            low, high = burst % SLOTS * tags // SLOTS, (burst % SLOTS + 1) * tags // SLOTS
            if high - low < 3:
                low, high = 0, tags
            tag = int(rng.integers(low + 1, high - 1)) if high - low > 2 else low
            time.sleep(max(0.0, (due_ns - time.time_ns()) * 1e-9))
            found.append(_until_new(session, pose_key("default", f"sim-{tag}"), due_ns))
    return found


def age_ms(session: zenoh.Session, tag: int) -> float:
    """Return the age of the pose of a tag, counted from 1970 before its first pose."""
    t_ns = _pose_time(session, pose_key("default", f"sim-{tag}"))
    return (time.time_ns() - t_ns) * 1e-6


def _until_new(session: zenoh.Session, key: str, due_ns: int) -> float:
    while True:
        new = _pose_time(session, key) >= due_ns
        late_ms = (time.time_ns() - due_ns) * 1e-6
        if new or late_ms > GIVE_UP_MS:
            return late_ms
        time.sleep(POLL_S)


def _pose_time(session: zenoh.Session, key: str) -> int:
    for reply in session.get(key, timeout=2.0):
        if reply.ok is not None:
            return int(json.loads(bytes(reply.ok.payload))["t_ns"])
    return 0
