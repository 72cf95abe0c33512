"""A program that measures what Zenoh alone costs.

It takes every message of the fleet out of a channel, as the service does, copies key and payload, and drops them.

Arguments: endpoint of a router, or "own" and the endpoint where this program is a router, as a service can be.
"""

import sys
import threading
import time
from typing import Any

import zenoh

from dropanchor_schemas.keys import all_sites
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.channel import drain
from dropanchor_service.zenoh_io.intake import CHANNEL_LENGTH
from dropanchor_service.zenoh_io.session import open_session
from support.zenoh_router import connected_session

GATHER_S = 0.02  # as a service with few tags does


def main(endpoint: str, own: bool) -> None:
    count = [0]

    def take_all(channel: Any) -> None:
        for sample in drain(channel, lambda _: time.sleep(GATHER_S)):
            count[0] += len((str(sample.key_expr), bytes(sample.payload))) // 2

    with open_session(ZenohSettings(listen=(endpoint,))) if own else connected_session(endpoint) as session:
        subscriber = session.declare_subscriber(all_sites("samples"), zenoh.handlers.FifoChannel(CHANNEL_LENGTH))
        thread = threading.Thread(target=take_all, args=(subscriber.handler,))
        thread.start()
        print("ready", flush=True)
        sys.stdin.readline()
        subscriber.undeclare()
        thread.join()
        print(f"{count[0]} {time.process_time()}", flush=True)


if __name__ == "__main__":
    main(sys.argv[-1], own=sys.argv[1] == "own")
