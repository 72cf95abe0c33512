"""A program: what Zenoh alone costs. Receives every message of the fleet, copies key and payload, and drops them."""

import sys
import time
from typing import Any

import zenoh

from dropanchor_schemas.keys import all_tags
from support.zenoh_router import connected_session


def main(endpoint: str) -> None:
    received = [0]

    def take(sample: zenoh.Sample) -> None:
        received[0] += len((str(sample.key_expr), bytes(sample.payload))) // 2

    with connected_session(endpoint) as session:
        callback: Any = zenoh.handlers.Callback(take, indirect=False)
        subscriber = session.declare_subscriber(all_tags("default", "samples"), callback)
        print("ready", flush=True)
        sys.stdin.readline()
        subscriber.undeclare()
        print(f"{received[0]} {time.process_time()}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
