"""A program that sends the messages of a fleet over real Zenoh sessions.

It prints "ready" once the service has subscribed to each session. Then it reads the start time (UTC in ns) from stdin,
sends, and prints a report after the next line on stdin.

Arguments: endpoint, first tag, number of tags, number of sessions, seconds, congestion control ("block" or "drop"),
the number of tags to register before, slowly and with two messages each, and the sites that share the tags.
"""

import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
import zenoh

from benchmarks.motion import MESSAGE_S, STEP_NS, message, tracks
from dropanchor_schemas.keys import all_tags, samples_key
from dropanchor_schemas.wire import ENCODING_PACKED
from support.zenoh_router import connected_session, wait_until

SLOTS = 40  # bursts per message period, 5 ms apart
REGISTERED_PER_S = 4000  # messages
REGISTERED_AT_ONCE = 1000  # tags, whose second messages follow their first ones
REGISTERING = 2  # messages that register a tag
Put = Callable[[int, bytes], None]


def main(
    endpoint: str,
    first: int,
    tags: int,
    sessions: int,
    duration_s: float,
    control: str,
    register: int,
    sites: list[str],
) -> None:
    motions = [track.bodies for track in tracks(duration_s + (1 + REGISTERING) * MESSAGE_S)]
    names = [samples_key(sites[index % len(sites)], f"sim-{first + index}") for index in range(max(tags, register))]
    encoding = zenoh.Encoding(ENCODING_PACKED)
    when_full = zenoh.CongestionControl.BLOCK if control == "block" else zenoh.CongestionControl.DROP
    with ExitStack() as stack:
        opened = [stack.enter_context(connected_session(endpoint)) for _ in range(sessions)]
        for session in opened:
            wait_for_listener(session, sites[0])

        def put(tag: int, payload: bytes) -> None:
            opened[tag % sessions].put(names[tag], payload, encoding=encoding, congestion_control=when_full)

        registered = register_all(put, motions, first, register)
        print("ready", flush=True)
        report = send(put, motions, first, tags, int(sys.stdin.readline()), round(duration_s / MESSAGE_S), registered)
        sys.stdin.readline()  # sessions stay open until everything has been counted
        print(json.dumps(report | {"registered": register}), flush=True)


def wait_for_listener(session: zenoh.Session, site: str = "default") -> None:
    """Wait for a subscriber to the samples. Messages that are put earlier are lost."""
    publisher = session.declare_publisher(all_tags(site, "samples"))

    def is_matching() -> bool:
        status = publisher.matching_status
        return bool(getattr(status, "matching", status))

    wait_until(is_matching, 60.0)
    publisher.undeclare()


def register_all(put: Put, motions: list[list[bytes]], first: int, count: int) -> int:
    """Send the first messages of `count` tags. Return the number of messages per tag."""
    for start in range(0, count, REGISTERED_AT_ONCE):
        for sequence in range(REGISTERING):
            for tag in range(start, min(start + REGISTERED_AT_ONCE, count)):
                motion = motions[(first + tag) % len(motions)]
                put(tag, message(motion[sequence], sequence, first + tag + 1, time.time_ns() // 1000 * 1000))
                if tag % (REGISTERED_PER_S // 100) == 0:
                    time.sleep(0.01)
    return REGISTERING if count else 0


def send(
    put: Put, motions: list[list[bytes]], first: int, tags: int, start_ns: int, rounds: int, registered: int
) -> dict[str, float]:
    """Send one message per tag and round, spread over the round. registered: number of messages per tag sent before."""
    edges = np.linspace(0, tags, SLOTS + 1).astype(int).tolist()
    late_ms = []
    for number in range(rounds):
        sequence = number + registered
        for slot in range(SLOTS):
            due_ns = start_ns + number * STEP_NS + slot * STEP_NS // SLOTS
            while (left_ns := due_ns - time.time_ns()) > 0:
                time.sleep(left_ns * 1e-9)
            for tag in range(edges[slot], edges[slot + 1]):
                motion = motions[(first + tag) % len(motions)]
                put(tag, message(motion[sequence], sequence, first + tag + 1, due_ns))
            late_ms.append((time.time_ns() - due_ns) * 1e-6)
    steady = late_ms[len(late_ms) // 2 :]
    return {
        "messages": rounds * tags,
        "late_p50_ms": float(np.percentile(steady, 50)),
        "late_p99_ms": float(np.percentile(steady, 99)),
        "cpu_s": time.process_time(),
    }


if __name__ == "__main__":
    given = sys.argv[1:]
    main(given[0], int(given[1]), int(given[2]), int(given[3]), float(given[4]), given[5], int(given[6]), given[7:])
