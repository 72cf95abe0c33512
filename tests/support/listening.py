"""Subscribers to the samples of a site."""

from collections.abc import Iterator
from contextlib import contextmanager

import zenoh
import zenoh.ext

from dropanchor_schemas import keys
from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, decode_packed, payload_encoding
from support.zenoh_router import connected_session, make_known


class ReceivedFrames:
    """The frames that a subscriber received, and the key of each."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.keys: list[str] = []

    def on_message(self, message: zenoh.Sample) -> None:
        packed = payload_encoding(str(message.encoding)) == ENCODING_PACKED
        frame = (decode_packed if packed else decode_json)(bytes(message.payload))
        assert isinstance(frame, Frame), frame
        self.keys.append(str(message.key_expr))
        self.frames.append(frame)  # the last, since tests wait for it

    def of(self, tag: str) -> list[Frame]:
        """Return the frames of one tag."""
        return [frame for key, frame in zip(self.keys, self.frames, strict=False) if tag in key.split("/")]

    def ranges(self) -> list[float]:
        """Return all received ranges in m."""
        return [sample.range_m for frame in self.frames for sample in frame.ranges]


@contextmanager
def listening(endpoint: str, site: str = "default") -> Iterator[ReceivedFrames]:
    """Subscribe to the samples of all tags of the site."""
    received = ReceivedFrames()
    everything = keys.all_tags(site, "samples")
    with connected_session(endpoint) as session, session.declare_subscriber(everything, received.on_message):
        make_known(session)
        yield received


@contextmanager
def listening_with_recovery(endpoint: str, site: str = "default") -> Iterator[ReceivedFrames]:
    """Subscribe to the samples of all tags of the site, and recover missed messages from the caches of the tags."""
    received = ReceivedFrames()
    recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    everything = keys.all_tags(site, "samples")
    with (
        connected_session(endpoint) as session,
        zenoh.ext.declare_advanced_subscriber(session, everything, received.on_message, recovery=recovery),
    ):
        make_known(session)
        yield received
