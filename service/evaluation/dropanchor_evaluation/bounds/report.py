"""Write the bounds as a table beside what the engine reached, and between markers in a page."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dropanchor_evaluation.bounds.rows import RowBound
from dropanchor_evaluation.product import report as product
from dropanchor_evaluation.product.rows import purpose
from dropanchor_evaluation.results import ROOT, Measured, NoPlaceError, require_place, write
from dropanchor_service.estimation.fleet.belief.rigidity import RIGID_SLIP
from dropanchor_service.estimation.fleet.configure import SLIP_UNKNOWN_STD, SLIP_UNKNOWN_TAU

NAME = "bounds"
SOURCES = ("service/evaluation/dropanchor_evaluation/bounds", *product.SOURCES)
COLUMNS = (
    *("motion / sensors / configured / start", "bound", "2nd half", "… class rigid", "… class loose"),
    *("efficient: RMSE", "2nd half", "up to rotation", "engine: RMSE", "2nd half", "up to rotation"),
)
LEGEND = (
    "Bound: root mean square of the position in m, median over the runs; over the whole run, over the second half, and "
    "that if an untold mount may slip as the engine assumes: within "
    f"{SLIP_UNKNOWN_TAU:g} s by {RIGID_SLIP:g} rad in its class rigid, by {SLIP_UNKNOWN_STD:g} rad in its class loose. "
    "Efficient: RMSE of tags whose errors are drawn from the Gaussian of the bound, median / 90 % of the tags, scored "
    "as the engine is. Engine: its row in the table above, if that has the same seeds. With an unknown start, bounds "
    "hold once the start is found, so only the second half is shown, and 6 axes are judged up to a rotation. The rows "
    "`mount` have the bound of `everything`."
)
ENGINE_COLUMNS = ("RMSE", "2nd half", "up to rotation")
NOTHING = "–"
Engine = Mapping[str, Sequence[str]]


def markdown(results: Sequence[RowBound], seeds: range, engine: Engine) -> str:
    """Return the table with its legend. engine: the cells of the engine by row."""
    lines = [_cells(COLUMNS), "|" + "---|" * len(COLUMNS), *(_line(result, engine) for result in results)]
    return "\n".join([*lines, "", LEGEND, "", f"Seeds {seeds[0]} to {seeds[-1]} ({purpose(seeds)})."])


def write_into(page: Path, results: Sequence[RowBound], seeds: range) -> None:
    """Write the table between its markers in a page of the project. Raises NoPlaceError, OSError."""
    measured = Measured(SOURCES, f"{seeds[0]}-{seeds[-1]}")
    write(ROOT, page, NAME, markdown(results, seeds, engine_cells(page, measured.seeds)), measured)


def engine_cells(page: Path, seeds: str) -> Engine:
    """Return the cells of the engine by row from the product's table in this page, or none if its seeds differ."""
    try:
        block = require_place(page, product.NAME).groupdict()
    except NoPlaceError:
        return {}
    if f'seeds="{seeds}"' not in (block.get("facts") or ""):
        return {}
    own = [product.COLUMNS.index(column) for column in ENGINE_COLUMNS]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in block["text"].splitlines()]
    return {row[0]: [row[i] for i in own] for row in rows if len(row) == len(product.COLUMNS)}


def _line(result: RowBound, engine: Engine) -> str:
    whole = result.row.start == "known"
    cases = (result.never_slips, result.class_rigid, result.class_loose)
    second = [_median([run.second_half for run in runs]) for runs in cases]
    efficient = [_median_and_p90(column) for column in np.concatenate([run.efficient for run in result.never_slips]).T]
    reached = engine.get(result.row.name, [NOTHING] * len(ENGINE_COLUMNS))
    return _cells(
        [
            result.row.name,
            _median([run.whole for run in result.never_slips]) if whole else NOTHING,
            *second,
            efficient[0] if whole else NOTHING,
            *efficient[1:],
            reached[0] if whole else NOTHING,
            *reached[1:],
        ]
    )


def _cells(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f}" if len(values) else NOTHING


def _median_and_p90(values: Sequence[float]) -> str:
    median, p90 = np.quantile(values, [0.5, 0.9])
    return f"{median:.2f} / {p90:.2f}"
