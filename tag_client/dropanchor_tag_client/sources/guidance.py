"""Guide a person through the motions of a calibration, and say what arrives and what is still missing."""

import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.sources.calibration_fit import NotEnoughError, fit, fit_rest

_CHECK_NS = 2_000_000_000
_MIN_DURATION_NS = 30_000_000_000
_STATUS_S = 3.0


class Guide:
    """The samples so far, and what they lack. source: where samples come from, for a person who waits for the first."""

    def __init__(self, source: str) -> None:
        self.samples: list[ImuSample] = []
        self._source, self._missing, self._rested, self._check_ns = source, "", False, 0

    def collect(self, stream: Iterable[ImuSample]) -> list[ImuSample]:
        """Return the samples once they suffice, at the end of the stream, or at Ctrl-C."""
        _say("Leave the tag alone.")
        with suppress(KeyboardInterrupt), self._repeated_status():
            for sample in stream:
                self.samples.append(sample)
                if sample.t_ns >= self._check_ns:
                    self._check_ns = sample.t_ns + _CHECK_NS
                    if self._suffice():
                        break
        return self.samples

    def _suffice(self) -> bool:
        try:
            if not self._rested:
                fit_rest(self.samples)
                self._rested, self._missing = True, ""
                _say("Now turn it through full circles, then swing it in figures of eight. Ctrl-C ends.")
            fit(self.samples)
        except NotEnoughError as error:
            if self._rested and str(error) != self._missing:
                _say(_sentence(str(error)))
            self._missing = str(error)
            return False
        self._missing = "keep turning"
        long_enough = self.samples[-1].t_ns - self.samples[0].t_ns > _MIN_DURATION_NS
        return long_enough or all(one.mag is None for one in self.samples)

    @contextmanager
    def _repeated_status(self) -> Iterator[None]:
        """Say every few seconds what arrives, also while the stream blocks."""
        ended = threading.Event()

        def repeat() -> None:
            before = len(self.samples)
            while not ended.wait(_STATUS_S):
                count = len(self.samples)
                _say(self._status(count, (count - before) / _STATUS_S))
                before = count

        thread = threading.Thread(target=repeat, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def _status(self, count: int, rate_hz: float) -> str:
        if not count:
            return f"No IMU sample yet. Waiting for {self._source}."
        seen = f"{count} samples, {rate_hz:.0f} per second."
        return f"{seen} {_sentence(self._missing)}" if self._missing else seen


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()
