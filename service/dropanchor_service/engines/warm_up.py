"""Compiling what is compiled before it is needed."""

import logging
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import numpy as np

from dropanchor_schemas.site import Site
from dropanchor_schemas.wire import (
    ENCODING_PACKED,
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    encode_packed,
)
from dropanchor_service.answers.answers import Answers
from dropanchor_service.estimation.columns import (
    ANCHOR,
    HEADING,
    HYPOTHESIS,
    IMU,
    POSE,
    RANGE,
    Engine,
    SampleBatch,
    State,
    default_settings,
)
from dropanchor_service.ingest.decode import read_forms, read_samples
from dropanchor_service.ingest.kernels.values import shift_times
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.screening import screen
from dropanchor_service.runtime.kernel_cache import VARIABLE
from dropanchor_service.store import LatestPoses, SiteStore, TagTable

SAY_EVERY_S = 5.0
NOT_TO_BE_FOUND: Final[Any] = None  # in the place of a module

_log = logging.getLogger(__name__)


@contextmanager
def _said_while_compiling(what: str) -> Iterator[None]:
    """A minute of silence looks like a fault, so it is said; at warning level, which nobody turns off."""
    from numba.core.event import Event, Listener, install_listener

    class Progress(Listener):
        """Told of every function, of which there are hundreds."""

        began: float | None = None
        said = 0.0

        def on_start(self, event: Event) -> None:  # noqa: ARG002
            now = time.monotonic()
            if self.began is None:
                self.began = self.said = now
                _log.warning("compiling %s, once after an update", what)
            elif now - self.said >= SAY_EVERY_S:
                self.said = now
                _log.warning("compiling: %.0f s so far", now - self.began)

        def on_end(self, event: Event) -> None: ...

    progress = Progress()
    with install_listener("numba:compile", progress):
        yield
    if progress.began is not None:
        elapsed = time.monotonic() - progress.began
        _log.warning("compiled in %.0f s; it is kept in %s", elapsed, os.environ.get(VARIABLE))


@contextmanager
def _without_blas() -> Iterator[None]:
    """Keep numba from importing scipy.linalg where scipy is installed, which it does to look for BLAS.

    No kernel of ours calls BLAS. The import would cost every start 0.2 s of processor time and 14 MB of memory.
    """
    found = sys.modules.setdefault("scipy.linalg", NOT_TO_BE_FOUND)
    try:
        yield
    finally:
        if found is NOT_TO_BE_FOUND:
            del sys.modules["scipy.linalg"]


@_without_blas()
@_said_while_compiling("the estimator, in about a minute")
def warm_up(engine: Engine) -> None:
    """Compile what `engine`, which is thrown away, runs: a second of a tag that moves off, seen by every sensor."""
    engine.set_anchors(np.zeros(1, ANCHOR))
    unknown, known = default_settings(), default_settings()
    known["start_known"], known["start_x"], known["start_y"], known["start_heading"] = True, 10.0, 0.0, 0.0
    for row, settings in enumerate((unknown, known)):
        engine.configure(row, settings)
    engine.process(_moving_off(2))


def _moving_off(rows: int) -> SampleBatch:
    n = 200
    row = np.repeat(np.arange(rows), n)
    t_ns = np.tile(np.arange(n) * 10_000_000, rows)
    imu, ranges, headings = np.zeros(rows * n, IMU), np.zeros(rows * n // 10, RANGE), np.zeros(rows * n // 10, HEADING)
    imu["row"], imu["t_ns"], imu["acc"], imu["mag"] = row, t_ns, (0.3, 0.0, 9.81), (0.0, 20.0, -40.0)
    for columns in (ranges, headings):
        columns["row"], columns["t_ns"], columns["std"] = row[::10], t_ns[::10], np.nan
    ranges["range"] = 10.0 + 0.15 * (t_ns[::10] * 1e-9) ** 2
    return SampleBatch(imu=imu, ranges=ranges, headings=headings)


@_without_blas()
@_said_while_compiling("the reader of messages")
def warm_up_ingest() -> None:
    """Compile what every message goes through: two of a publisher, with a gap between, and one alone, whose columns
    are another type to the compiler, for they have no strides."""
    frame = Frame(
        [ImuSample(1, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))],
        [RangeSample(1, 7, 1.0)],
        [HeadingSample(1, 0.0)],
        [BearingSample(1, 7, 0.0)],
        boot_id=1,
        boot_clock=True,
    )
    payloads = [encode_packed(replace(frame, sequence=number)) for number in (0, 2)]
    for some in (payloads, payloads[:1]):
        _pass(some)


def _pass(payloads: list[bytes]) -> None:
    read = read_forms(payloads, [ENCODING_PACKED] * len(payloads))
    publishers, arrivals = Publishers(), np.zeros(len(payloads), np.int64)
    sequenced = publishers.sequence(read.forms, np.zeros(len(payloads), np.int32), arrivals, 0)
    decoded, _ = screen(read_samples(read, sequenced.due))
    samples = [(decoded.imu["message"], decoded.imu["t_ns"]), (decoded.ranges["message"], decoded.ranges["t_ns"])]
    offsets, _ = publishers.time_offsets(read.forms, sequenced, arrivals, samples)
    for messages, t_ns in samples:
        shift_times(t_ns, messages, offsets)


@_without_blas()
@_said_while_compiling("the writer of answers")
def warm_up_answers() -> None:
    """Compile what every answer goes through: an old pose, and one of a tag that may be in two places."""
    answers = Answers(SiteStore(Site(), {}), TagTable(), LatestPoses())
    poses, modes = np.zeros(2, POSE), np.zeros(2, HYPOTHESIS)
    for row in range(len(poses)):
        answers.tags.register(f"tag-{row}")
        poses["row"][row] = row
    poses["t_ns"] = [0, answers.now_ns()]
    poses["state"], modes["row"] = State.AMBIGUOUS, 1
    answers.latest.write(poses, modes)
    b"".join(answers.pose_list_json())
