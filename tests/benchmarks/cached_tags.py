"""A program that publishes what the tags of many sites measure, each tag with a cache, each site over a session.

It prints "ready" once a service has subscribed to all sites. Then it reads the time of the first message (UTC in ns)
from stdin. It sends after the line "go" and until the line "pause", and then prints a report, as often as it is told.
The caches stay until it is ended. During a pause the tags move on.

Arguments: endpoint, number of tags of a site, and the sites.
"""

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from threading import Event, Thread

import numpy as np
import zenoh

from benchmarks.generator import wait_for_listener
from benchmarks.motion import STEP_NS, Track, message, tracks
from dropanchor_schemas.keys import samples_key, tag_alive_key
from dropanchor_schemas.wire import ENCODING_PACKED
from dropanchor_tag_client.publisher import declare_publisher
from dropanchor_tag_client.simulator.live import tag_name
from support.zenoh_router import connected_session

LONGEST_S = 1800.0
MOTIONS = 6  # distinct ones; tag i moves like i % MOTIONS
CACHED = 600  # messages of a tag: two minutes
SLOTS = 20  # bursts in the time between two messages of a tag


def motion_of(motions: Sequence[Track], tag: int) -> Track:
    """Return how a tag moves. tag: its number among the tags of all sites."""
    return motions[tag % len(motions)]


def payload_of(motions: Sequence[Track], tag: int, tags: int, sequence: int, number: int, start_ns: int) -> bytes:
    """Return a message of one of `tags` tags. number: of 0.2 s since the start. sequence: of its messages so far."""
    due_ns = start_ns + number * STEP_NS + tag * SLOTS // tags * STEP_NS // SLOTS
    return message(motion_of(motions, tag).bodies[number], sequence, tag + 1, due_ns)


def main(endpoint: str, tags: int, sites: Sequence[str]) -> None:
    motions = tracks(LONGEST_S, MOTIONS)
    with ExitStack() as stack:
        puts = [put for site in sites for put in _publishers(stack, endpoint, site, tags)]
        print("ready", flush=True)
        start_ns, going = int(sys.stdin.readline()), Event()
        Thread(target=_obey, args=(going,), daemon=True).start()
        _send_all(Fleet(puts, motions, start_ns), start_ns, going)


def _obey(going: Event) -> None:
    for line in sys.stdin:
        going.set() if line == "go\n" else going.clear()


def _publishers(stack: ExitStack, endpoint: str, site: str, tags: int) -> Iterator[Callable[[bytes], object]]:
    session = stack.enter_context(connected_session(endpoint))
    wait_for_listener(session, site)
    for name in map(tag_name, range(tags)):
        token: zenoh.LivelinessToken = session.liveliness().declare_token(tag_alive_key(site, name))
        stack.callback(token.undeclare)
        key = samples_key(site, name)
        yield declare_publisher(session, key, ENCODING_PACKED, cache_messages=CACHED, wait_when_congested=False).put


class Fleet:
    """Sends the messages of all tags, spread over 0.2 s. late_ms: of the bursts so far."""

    def __init__(self, puts: Sequence[Callable[[bytes], object]], motions: Sequence[Track], start_ns: int) -> None:
        self.late_ms: list[float] = []
        self._puts = puts
        self._motions = motions
        self._start_ns = start_ns
        self._edges = [-(-slot * len(puts) // SLOTS) for slot in range(SLOTS + 1)]

    def send(self, sequence: int, number: int) -> None:
        for slot in range(SLOTS):
            due_ns = self._start_ns + number * STEP_NS + slot * STEP_NS // SLOTS
            while (left_ns := due_ns - time.time_ns()) > 0:
                time.sleep(left_ns * 1e-9)
            for tag in range(self._edges[slot], self._edges[slot + 1]):
                payload = payload_of(self._motions, tag, len(self._puts), sequence, number, self._start_ns)
                self._puts[tag](payload)
            self.late_ms.append((time.time_ns() - due_ns) * 1e-6)


def _send_all(fleet: Fleet, start_ns: int, going: Event) -> None:
    """Send while it is going, and print after each time the numbers that every tag has sent, from and to."""
    sequence, sent = 0, list[tuple[int, int]]()
    while going.wait():
        first = number = max(0, -(-(time.time_ns() - start_ns) // STEP_NS))
        while going.is_set():
            fleet.send(sequence, number)
            sequence, number = sequence + 1, number + 1
        sent.append((first, number))
        print(json.dumps({"sent": sent, "late_p99_ms": float(np.percentile(fleet.late_ms, 99))}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3:])
