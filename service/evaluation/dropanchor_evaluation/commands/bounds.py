"""`dropanchor evaluate bounds`: the accuracy that no engine can exceed on the samples of tags, as a table."""

import argparse
from pathlib import Path

from tqdm import tqdm

from dropanchor_evaluation.bounds.report import NAME, markdown, write_into
from dropanchor_evaluation.bounds.rows import RowBound, bounded_rows, work
from dropanchor_evaluation.commands.product import QUICK_SEEDS, SEEDS, seed_range
from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.product.rows import QUICK, selected
from dropanchor_evaluation.product.work import tasks
from dropanchor_evaluation.results import require_place


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quick", action="store_true", help="fewer rows and three development seeds")
    parser.add_argument("--rows", nargs="+", metavar="PATTERN", help="as for `product`; only rows of vehicles")
    parser.add_argument("--seeds", type=seed_range, metavar="A-B", help="as for `product`, with the same default")
    parser.add_argument("--list", action="store_true", help="print the names of the rows and exit")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="write the table between its markers in this page")


def run(arguments: argparse.Namespace) -> int:
    """Compute the bounds of the selected rows and return 0. Raises NoRowError, NoPlaceError and OSError."""
    quick = [pattern for pattern in QUICK if pattern.startswith("*")]
    rows = selected(bounded_rows(), arguments.rows or (quick if arguments.quick and not arguments.list else ()))
    if arguments.list:
        print(*(row.name for row in rows), sep="\n")
        return 0
    if arguments.into:
        require_place(arguments.into, NAME)
    seeds = arguments.seeds or (QUICK_SEEDS if arguments.quick else SEEDS)
    results: list[RowBound] = []
    with Workers(arguments.processes) as workers, tqdm(total=len(rows), unit="row") as bar:
        for found in workers.map(work, tasks(rows, seeds)):
            results += found
            bar.update(len(found))
    print(markdown(results, seeds, {}))
    if arguments.into:
        write_into(arguments.into, results, seeds)
    return 0
