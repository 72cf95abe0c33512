"""What a subscriber hears of the samples of a site."""

from collections.abc import Iterator
from contextlib import contextmanager

import zenoh
import zenoh.ext

from dropanchor_schemas import decode_json, keys
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, decode_packed, payload_encoding
from support.zenoh_router import connected_session


class Heard:
    """The frames that a subscriber receives."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.keys: list[str] = []

    def take(self, message: zenoh.Sample) -> None:
        packed = payload_encoding(str(message.encoding)) == ENCODING_PACKED
        frame = (decode_packed if packed else decode_json)(bytes(message.payload))
        assert isinstance(frame, Frame), frame
        self.frames.append(frame)
        self.keys.append(str(message.key_expr))

    def ranges(self) -> list[float]:
        return [sample.range_m for frame in self.frames for sample in frame.ranges]


@contextmanager
def listening(endpoint: str, site: str = "default") -> Iterator[Heard]:
    """A plain subscriber to all tags of the site."""
    heard = Heard()
    everything = keys.all_tags(site, "samples")
    with connected_session(endpoint) as session, session.declare_subscriber(everything, heard.take):
        list(session.get("nobody/answers", timeout=1.0))  # a round trip: the router knows of the subscription
        yield heard


@contextmanager
def listening_with_recovery(endpoint: str, site: str = "default") -> Iterator[Heard]:
    """A subscriber that asks the tags for what it missed."""
    heard = Heard()
    recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    everything = keys.all_tags(site, "samples")
    with (
        connected_session(endpoint) as session,
        zenoh.ext.declare_advanced_subscriber(session, everything, heard.take, recovery=recovery),
    ):
        list(session.get("nobody/answers", timeout=1.0))
        yield heard
