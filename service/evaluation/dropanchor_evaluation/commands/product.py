"""`dropanchor evaluate product`: evaluate the whole engine on the samples of tags, as a table."""

import argparse
from pathlib import Path

from tqdm import tqdm

from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.product.report import NAME, markdown, write_into, write_json
from dropanchor_evaluation.product.rows import (
    DEVELOPMENT_SEEDS,
    FIRST_REPORTED_SEED,
    QUICK,
    purpose,
    recorded_rows,
    selected,
    simulated_rows,
)
from dropanchor_evaluation.product.work import Result, prepare, tasks, work
from dropanchor_evaluation.results import require_place

SEEDS = range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + 100)
QUICK_SEEDS = range(DEVELOPMENT_SEEDS[0], DEVELOPMENT_SEEDS[0] + 3)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quick", action="store_true", help="fewer rows and three development seeds")
    parser.add_argument(
        "--rows", nargs="+", metavar="PATTERN", help="motion/sensors/configured/start, with * and ?; --list shows all"
    )
    parser.add_argument(
        "--seeds",
        type=seed_range,
        metavar="A-B",
        help=f"seeds of the runs (default: {SEEDS[0]}-{SEEDS[-1]}); for development use "
        f"{DEVELOPMENT_SEEDS[0]}-{DEVELOPMENT_SEEDS[-1]} only",
    )
    parser.add_argument("--list", action="store_true", help="print the names of the rows and exit")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write product.json and product.md to this folder")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="write the table between its markers in this page")


def seed_range(text: str) -> range:
    """Return the seeds of `A-B`, both included, or of a single `A`."""
    first, dash, last = text.partition("-")
    try:
        seeds = range(int(first), int(last if dash else first) + 1)
        purpose(seeds)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: expected A-B; {error}") from error
    return seeds


def run(arguments: argparse.Namespace) -> int:
    """Run the selected rows and return 0. Raises NoRowError, NoPlaceError, RecordingError and OSError."""
    every = [*simulated_rows(), *recorded_rows(arguments.data)]
    rows = selected(every, arguments.rows or (QUICK if arguments.quick and not arguments.list else ()))
    if arguments.list:
        print(*(row.name for row in rows), sep="\n")
        return 0
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.into:
        require_place(arguments.into, NAME)
    seeds = arguments.seeds or (QUICK_SEEDS if arguments.quick else SEEDS)
    prepare()  # once, so that the processes do not all compile the same kernels
    results: list[Result] = []
    with Workers(arguments.processes) as workers, tqdm(total=len(rows), unit="row") as bar:
        for found in workers.map(work, tasks(rows, seeds)):
            results += found
            bar.update(len(found))
            bar.set_description(found[-1].row.motion)
    _write(arguments, results, seeds)
    return 0


def _write(arguments: argparse.Namespace, results: list[Result], seeds: range) -> None:
    text = markdown(results, seeds)
    print(text)
    if arguments.out:
        write_json(arguments.out / "product.json", results, seeds)
        (arguments.out / "product.md").write_text(text + "\n", encoding="utf-8")
    if arguments.into:
        write_into(arguments.into, results, seeds)
