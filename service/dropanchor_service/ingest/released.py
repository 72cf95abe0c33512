"""The numbers of messages that were passed on, and that may not be fused yet."""

from collections.abc import Iterable, Mapping, Sequence

from dropanchor_service.ingest.publishers import SequenceState
from dropanchor_service.ingest.suspended import Number, Suspended


class Released:
    """Runs of numbers, by the boot id of their publisher: thousands of messages follow each other without a gap."""

    def __init__(self) -> None:
        self._runs: dict[int, list[range]] = {}

    def __contains__(self, number: Number) -> bool:
        return any(number.sequence in run for run in self._runs.get(number.boot_id, ()))

    def add(self, number: Number) -> None:
        runs, end = self._runs.setdefault(number.boot_id, []), number.sequence + 1
        if runs and runs[-1].stop == number.sequence:
            runs[-1] = range(runs[-1].start, end)
        else:
            runs.append(range(number.sequence, end))

    def new(self, suspended: Sequence[Suspended], states: Mapping[int, SequenceState]) -> list[Suspended]:
        """Return the messages that are not on their way to the estimator already.

        While it is behind, what was fused does not tell, and the caches may be asked again. What came twice could then
        be so old that its publisher seems to have begun to count again. states: of publishers; what they have passed
        is forgotten.
        """
        for boot_id, runs in list(self._runs.items()):
            if (state := states.get(boot_id)) is not None:
                ahead = (run[max(0, -state.ahead(run.start)) :] for run in runs)
                self._runs[boot_id] = [run for run in ahead if run]
        return [message for message in suspended if message.number is None or message.number not in self]

    def forget_from(self, numbers: Iterable[Number]) -> None:
        """Forget these numbers, which came back, and those after them."""
        for boot_id, sequence, _ in numbers:
            runs = self._runs.get(boot_id, ())
            self._runs[boot_id] = [range(run.start, min(run.stop, sequence)) for run in runs if run.start < sequence]
