"""Send a burst of frames of one tag over Zenoh: `python -m benchmarks.burst ENDPOINT KEY FRAMES BOOTS`.

It waits for a line on its standard input before it sends. FRAMES: how many. BOOTS: `one` boot id, or a `new` one for
each frame.
"""

import sys
import time

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, RangeSample, encode_packed
from support.zenoh_router import connected_session

SPACING_NS = 10_000  # between the samples of two frames


def payloads(count: int, boots: str, end_ns: int) -> list[bytes]:
    """Return `count` frames with a range each, the last one of `end_ns`."""
    return [
        encode_packed(
            Frame(
                ranges=[RangeSample(end_ns - (count - 1 - number) * SPACING_NS, 7, 22.0, 0.1)],
                sequence=number,
                boot_id=1 if boots == "one" else number + 1,
            )
        )
        for number in range(count)
    ]


def main(endpoint: str, key: str, frames: int, boots: str) -> None:
    with connected_session(endpoint) as session:
        ready = payloads(frames, boots, time.time_ns())
        print("ready", flush=True)
        sys.stdin.readline()
        begun = time.monotonic()
        for payload in ready:
            session.put(key, payload, encoding=ENCODING_PACKED)
        print(f"{time.monotonic() - begun:.2f}", flush=True)
        sys.stdin.readline()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4])
