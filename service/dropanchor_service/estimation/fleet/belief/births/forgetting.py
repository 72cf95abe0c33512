"""Forget what a row has learned, part by part."""

from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import Row
from dropanchor_service.estimation.fleet.belief.states import INITIALISING
from dropanchor_service.estimation.fleet.compiled import njit

STARTED: Final = 1  # the ranges that a start collects, that north is known, and what is published
PLACE: Final = 2  # where the tag started, told or from before a gap
REFERENCE_ERROR: Final = 4  # the error of the heading reference
MODE: Final = 8  # that one mode has explained all ranges
MISFIT: Final = 16  # that ranges were outliers
RUNS: Final = 32  # how many ranges in a row were too long or too short
WALK: Final = 64  # that a person carries the tag, and where the steps began
GAP: Final = 128  # that motion was not observed
NOISE: Final = 256  # how much the ranges scatter

TRACK: Final = STARTED | REFERENCE_ERROR | MODE | MISFIT | WALK  # all that its hypotheses learned
SIGHT: Final = MISFIT | RUNS  # what the ranges said of line of sight and track


@njit(nogil=True)
def forget(row: Row, parts: int) -> None:
    """Forget these parts of a row. Its hypotheses go where it starts again."""
    if parts & STARTED:
        row.start.range_count = 0
        row.start.collected_s = row.start.way = 0.0
        row.heading.in_site_frame = 0
        row.publication.state = INITIALISING
        row.publication.information[:] = 0.0
    if parts & PLACE:
        row.start.known = row.start.after_gap = 0
    if parts & REFERENCE_ERROR:
        row.heading.models_started = row.heading.model = 0
        row.heading.slow_var = 0.0
    if parts & MODE:
        row.publication.resolved = 0
        row.publication.resolved_s = 0.0
    if parts & MISFIT:
        row.nlos.misfit = row.nlos.misfit_s = 0.0
        row.nlos.widened = 0
    if parts & RUNS:
        row.nlos.high_run = row.nlos.low_run = 0
    if parts & WALK:
        row.walk.carried = 0
        row.walk.var = 0.0
    if parts & NOISE:
        row.noise.white_var = 0.0
    if parts & GAP:
        row.gap.unobserved_s = 0.0
