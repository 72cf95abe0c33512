"""`dropanchor evaluate smoothed`: the smoother beside the filter, as a table."""

import argparse
from pathlib import Path

from tqdm import tqdm

from dropanchor_evaluation.commands.product import seed_range
from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.product.rows import DEVELOPMENT_SEEDS, recorded_rows, selected, simulated_rows
from dropanchor_evaluation.product.smoothing import NAME, ROWS, Smoothed, Task, markdown, work, write_into
from dropanchor_evaluation.product.work import prepare
from dropanchor_evaluation.results import require_place

SEEDS = range(DEVELOPMENT_SEEDS[0], DEVELOPMENT_SEEDS[0] + 20)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rows", nargs="+", metavar="PATTERN", help=f"rows as those of `product` (default: {len(ROWS)})"
    )
    parser.add_argument(
        "--seeds",
        type=seed_range,
        default=SEEDS,
        metavar="A-B",
        help=f"as for `product` (default: {SEEDS[0]}-{SEEDS[-1]})",
    )
    parser.add_argument("--into", type=Path, metavar="PAGE", help="write the table between its markers in this page")


def run(arguments: argparse.Namespace) -> int:
    """Run the selected rows and return 0. Raises NoRowError, NoPlaceError, RecordingError and OSError."""
    rows = selected([*simulated_rows(), *recorded_rows(arguments.data)], arguments.rows or ROWS)
    if arguments.into:
        require_place(arguments.into, NAME)
    prepare()
    results: list[Smoothed] = []
    with Workers(arguments.processes) as workers, tqdm(total=len(rows), unit="row") as bar:
        for found in workers.map(work, [Task(row, arguments.seeds) for row in rows]):
            results.append(found)
            bar.update()
            bar.set_description(found.row.motion)
    print(markdown(results, arguments.seeds))
    if arguments.into:
        write_into(arguments.into, results, arguments.seeds)
    return 0
