"""`dropanchor evaluate ablate`: take each rule of the engine out, one at a time, and show what it buys."""

import argparse
from pathlib import Path

from tqdm import tqdm

from dropanchor_evaluation.ablation.report import NAME, gathered, markdown, without_effect, write_into
from dropanchor_evaluation.ablation.rules import RULES, selected
from dropanchor_evaluation.ablation.work import ablate, count_steps
from dropanchor_evaluation.commands.product import seed_range
from dropanchor_evaluation.product.rows import DEVELOPMENT_SEEDS, Row, recorded_rows, simulated_rows
from dropanchor_evaluation.product.rows import selected as selected_rows
from dropanchor_evaluation.product.work import prepare
from dropanchor_evaluation.results import require_place

SEEDS = DEVELOPMENT_SEEDS[:100]
QUICK_SEEDS = DEVELOPMENT_SEEDS[:8]
QUICK = ("S5/scalar/everything/known", "M5/9-axis/nothing/unknown", "walk-hand/9-axis/nothing/known")
ROWS = (
    *("S5/scalar/everything/*", "M5/scalar/nothing/*", "C5/scalar/nothing/known", "P/9-axis/everything/known"),
    *("S5/9-axis/nothing/*", "OU/9-axis/nothing/unknown", "C5/9-axis/everything/known", "forklift/9-axis/nothing/*"),
    *("rolling/9-axis/nothing/known", "walk-*/9-axis/nothing/known", "walk-hand/scalar/nothing/unknown"),
    *("*/recorded/operator/known", "*/recorded/nothing/known"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--quick", action="store_true", help="three rows, eight seeds, and no rule that needs compiling"
    )
    parser.add_argument("--rules", nargs="+", metavar="PATTERN", help="names of rules, with * and ?; --list shows all")
    parser.add_argument("--rows", nargs="+", metavar="PATTERN", help="rows as those of `product`")
    parser.add_argument(
        "--seeds", type=seed_range, metavar="A-B", help=f"seeds of the runs (default: {SEEDS[0]}-{SEEDS[-1]})"
    )
    parser.add_argument("--list", action="store_true", help="print the rules, the rows they were made for, and exit")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="write the table between its markers in this page")


def run(arguments: argparse.Namespace) -> int:
    """Take the selected rules out, print the table, and return 0.

    Raises NoRuleError, NoRowError, NoPlaceError, RecordingError and OSError.
    """
    rules = selected(arguments.rules or ())
    if arguments.list:
        width = max(len(rule.name) for rule in RULES)
        print(*(f"{rule.name:{width}}  {rule.made_for}" for rule in rules), sep="\n")
        return 0
    if arguments.quick and not arguments.rules:
        rules = [rule for rule in rules if not rule.constants]
    if arguments.into:
        require_place(arguments.into, NAME)
    rows = _rows(arguments)
    seeds = arguments.seeds or (QUICK_SEEDS if arguments.quick else SEEDS)
    prepare()
    outcomes = []
    with tqdm(total=count_steps(rows, seeds, rules), unit="step") as bar:
        for found in ablate(rows, seeds, rules, arguments.processes):
            outcomes += found
            bar.update()
    tags = gathered(outcomes)
    text = markdown(tags, rules, seeds)
    print(text)
    print("Without an effect that can be seen:", ", ".join(without_effect(tags)) or "none")
    if arguments.into:
        write_into(arguments.into, text, seeds)
    return 0


def _rows(arguments: argparse.Namespace) -> list[Row]:
    """Return the rows that were asked for, or the usual ones. Raises NoRowError."""
    recorded = recorded_rows(arguments.data)
    usual = ROWS if recorded else tuple(pattern for pattern in ROWS if "/recorded/" not in pattern)
    return selected_rows([*simulated_rows(), *recorded], arguments.rows or (QUICK if arguments.quick else usual))
