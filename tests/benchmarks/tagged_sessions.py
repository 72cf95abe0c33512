"""A program that runs tags with a Zenoh session and a liveliness token each, which send once a second."""

import sys
import threading
import time
from contextlib import ExitStack

import zenoh

from benchmarks.generator import wait_for_listener
from benchmarks.motion import message, tracks
from dropanchor_schemas.keys import samples_key, tag_alive_key
from dropanchor_schemas.wire import ENCODING_PACKED
from support.zenoh_router import connected_session


def main(endpoint: str, count: int) -> None:
    bodies = tracks(60.0, 1)[0].bodies
    encoding, when_full = zenoh.Encoding(ENCODING_PACKED), zenoh.CongestionControl.DROP
    ended = threading.Event()
    threading.Thread(target=wait_for_end, args=(ended,), daemon=True).start()
    with ExitStack() as stack:
        opened = [stack.enter_context(connected_session(endpoint)) for _ in range(count)]
        tokens = [s.liveliness().declare_token(tag_alive_key("default", f"own-{i}")) for i, s in enumerate(opened)]
        wait_for_listener(opened[-1])
        print("ready", flush=True)
        for sequence in range(len(bodies)):
            began_s = time.monotonic()
            for tag, session in enumerate(opened):
                payload = message(bodies[sequence], sequence, tag + 1, time.time_ns() // 1000 * 1000)
                session.put(
                    samples_key("default", f"own-{tag}"), payload, encoding=encoding, congestion_control=when_full
                )
            if ended.wait(max(0.0, 1.0 - (time.monotonic() - began_s))):
                break
        print(f"{sequence + 1} {len(tokens)}", flush=True)


def wait_for_end(ended: threading.Event) -> None:
    sys.stdin.readline()
    ended.set()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
