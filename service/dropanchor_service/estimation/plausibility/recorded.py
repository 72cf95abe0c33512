"""Check the samples of a recording, which are all there at once."""

from collections.abc import Iterator

import numpy as np

from dropanchor_service.estimation.columns import SampleBatch
from dropanchor_service.estimation.plausibility.check import SensorCheck
from dropanchor_service.estimation.plausibility.verdicts import Finding

STEP_NS = 1_000_000_000


def findings_of(samples: SampleBatch) -> list[Finding]:
    """Return what the check finds in the samples of row 0, in order of time, and whether it could not judge all."""
    check, found = SensorCheck(), dict[str, Finding]()
    check.start(0)
    for batch in in_steps(samples):
        check.check(batch)
        found |= {finding.name: finding for finding in (*check.findings(0), *check.unjudged(0))}
    return list(found.values())


def in_steps(samples: SampleBatch) -> Iterator[SampleBatch]:
    """Yield the samples of each second. Every column is in order of time."""
    times = [column["t_ns"] for column in samples.columns() if len(column)]
    if not times:
        return
    begin, end = min(int(t_ns[0]) for t_ns in times), max(int(t_ns[-1]) for t_ns in times)
    edges = np.arange(begin, end + 2 * STEP_NS, STEP_NS)
    places = [np.searchsorted(column["t_ns"], edges) for column in samples.columns()]
    for i in range(len(edges) - 1):
        columns = zip(samples.columns(), places, strict=True)
        yield SampleBatch(*(column[place[i] : place[i + 1]] for column, place in columns))
