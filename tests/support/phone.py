"""A phone that posts recordings."""

from collections.abc import Callable
from typing import Generic

from dropanchor_schemas.wire import ENCODING_JSON, Frame, ImuSample, decode_packed
from dropanchor_service.phones.intake import M, PhoneIntake, Session
from dropanchor_tag_client.sources.phones.pairing import Signs


class Phone(Generic[M]):
    """An intake of an app's messages, and what it put out for the one tag `anna`."""

    def __init__(self, parse: Callable[[bytes], M | None], new_session: Callable[[Signs], Session[M]]) -> None:
        self.now_s = 0.0
        self.frames: list[Frame] = []
        self.counted: list[bytes] = []
        self.health: list[tuple[str, bytes, str]] = []
        self.intake = PhoneIntake(
            self._receive, lambda *report: self.health.append(report), parse, new_session, lambda: self.now_s
        )

    def _receive(self, tag: str, payload: bytes, encoding: str) -> None:
        assert tag == "anna"
        if encoding == ENCODING_JSON:
            self.counted.append(payload)
            return
        frame = decode_packed(payload)
        assert isinstance(frame, Frame)
        self.frames.append(frame)

    def post(self, body: bytes) -> int:
        return self.intake.post("anna", body).samples

    @property
    def samples(self) -> list[ImuSample]:
        return [sample for frame in self.frames for sample in frame.imu]
