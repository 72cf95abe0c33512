"""`dropanchor evaluate`: run the experiments of the paper, real recordings, and the whole engine."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from dropanchor_evaluation import recordings
from dropanchor_evaluation.ablation.rules import NoRuleError
from dropanchor_evaluation.commands import ablate, bounds, product, smoothed
from dropanchor_evaluation.paper.whole import FULL, QUICK, TITLE, Experiment, experiments, preface
from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.product.rows import NoRowError
from dropanchor_evaluation.report import Section, markdown_section, markdown_table, write_report
from dropanchor_evaluation.results import ROOT, Measured, NoPlaceError, require_place, write
from dropanchor_service.offline.plaza import FILES, read_plaza
from dropanchor_tag_client.recording import RecordingError

DESCRIPTION = """\
paper       all experiments of the paper that need none of its hardware, in a report with the paper's own numbers:
            report.html, report.md, results.json and pictures; takes some minutes on two cores
recordings  the paper's filter and the engine fleet on real recordings with ground truth
product     the whole engine on the samples of tags: scalar, 9-axis or 6-axis sensors; everything, the mounting angle
            or nothing configured; known and unknown start; vehicles, trolley, forklift, walks, recordings
bounds      what no engine can exceed in the rows of `product` with vehicles: posterior Cramér-Rao bounds
smoothed    the smoother beside the filter: poses that use later samples, in some rows of `product`
ablate      each rule of the engine out, one at a time: what it buys in rows of `product` and on recordings
"""
EPILOG = """\
examples:
  dropanchor evaluate paper --out report            the whole report
  dropanchor evaluate paper --out report --quick    a few seeds, to test that it runs
  dropanchor evaluate recordings --plaza            real ranges and RTK truth from PyPI's gtsam
  dropanchor evaluate recordings --data FOLDER      your own recordings, one folder each, with truth.csv
  dropanchor evaluate product --quick               a few rows and three development seeds
  dropanchor evaluate product --rows 'S5/*' 'walk-*/9-axis/*' --seeds 5000-5019
  dropanchor evaluate bounds --rows 'S5/*' --seeds 5000-5019
  dropanchor evaluate smoothed --seeds 5000-5004    filtered beside smoothed, with few seeds
  dropanchor evaluate ablate --quick                what the rules buy in three rows
  dropanchor evaluate ablate --rules 'birth: turned-after-stop' --rows 'forklift/*' --seeds 5000-5999
"""
DATA = Path("../shared/data")
SOURCES = ("service/dropanchor_service/estimation", "service/evaluation/dropanchor_evaluation/paper")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_subparsers(required=True, metavar="WHAT", dest="what")
    paper = what.add_parser("paper", help="the experiments of the paper")
    paper.add_argument(
        "--out", type=Path, default=Path("report"), metavar="DIR", help="output folder (default: report)"
    )
    paper.add_argument("--quick", action="store_true", help="few seeds: a test that it runs, not of its accuracy")
    _add_into(paper)
    _add_common(paper)
    real = what.add_parser("recordings", help="real recordings with ground truth")
    real.add_argument("--plaza", action="store_true", help="the Plaza sets of the package gtsam")
    real.add_argument("--out", type=Path, metavar="DIR", help="also write a report to this folder")
    _add_into(real)
    _add_common(real)
    product.add_arguments(what.add_parser("product", help="the whole engine on the samples of tags"))
    _add_common(what.choices["product"])
    bounds.add_arguments(what.add_parser("bounds", help="what no engine can exceed on these samples"))
    _add_processes(what.choices["bounds"])
    smoothed.add_arguments(what.add_parser("smoothed", help="the smoother beside the filter"))
    _add_common(what.choices["smoothed"])
    ablate.add_arguments(what.add_parser("ablate", help="what each rule of the engine buys"))
    _add_common(what.choices["ablate"])


def _add_into(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--into", type=Path, metavar="PAGE", help="put the tables between their markers in a page")


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("DROPANCHOR_DATA", DATA)),
        metavar="DIR",
        help=f"folder of recordings (default: $DROPANCHOR_DATA or {DATA})",
    )
    _add_processes(parser)


def _add_processes(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--processes",
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of processes (default: one per core)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run an evaluation. Return 0 on success, 2 if recordings are unusable or nothing can be written, 130 on Ctrl-C."""
    try:
        run_it = {
            "paper": _paper,
            "recordings": _recordings,
            "product": product.run,
            "bounds": bounds.run,
            "smoothed": smoothed.run,
            "ablate": ablate.run,
        }
        return run_it[arguments.what](arguments)
    except (RecordingError, NoRowError, NoRuleError, NoPlaceError, OSError) as error:
        print(f"dropanchor evaluate: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return 130


def _paper(arguments: argparse.Namespace) -> int:
    plan = QUICK if arguments.quick else FULL
    _require_place(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)  # before the minutes of work, not after them
    with Workers(arguments.processes) as workers:
        sections = _run_all(experiments(plan, workers, arguments.data))
    write_report(arguments.out, TITLE, preface(plan), sections)
    print(f"report: {arguments.out / 'report.html'}")
    if arguments.into:
        own = [section for section in sections if section.key != "recordings"]  # they have a page of their own
        text = "\n\n".join([*preface(plan), *(f"### {one.title}\n\n{markdown_section(one)}" for one in own)])
        write(ROOT, arguments.into, "paper", text, Measured(SOURCES, f"0-{plan.families - 1}"))
    return 0


def _require_place(arguments: argparse.Namespace) -> None:
    if arguments.into:
        require_place(arguments.into, arguments.what)


def _recordings(arguments: argparse.Namespace) -> int:
    _require_place(arguments)
    with Workers(arguments.processes) as workers:
        if arguments.plaza:
            plaza = [read_plaza(name) for name in FILES]
            todo = Experiment("Plaza", len(plaza), lambda step: recordings.run_read(workers, step, plaza))
        else:
            folders = recordings.recordings_in(arguments.data)
            if not folders:
                raise RecordingError(f"{arguments.data} holds no recording with a truth.csv; give a folder with --data")
            todo = Experiment("recordings", len(folders), lambda step: recordings.run(workers, step, folders))
        sections = _run_all([todo])
    for section in sections:
        print(section.finding, *section.text, *(markdown_table(table) for table in section.tables), sep="\n\n")
    if arguments.out:
        write_report(arguments.out, "Real recordings", [], sections)
        print(f"report: {arguments.out / 'report.html'}")
    if arguments.into:
        text = "\n\n".join(markdown_section(section) for section in sections)
        write(ROOT, arguments.into, "recordings", text, Measured(SOURCES[:1]))
    return 0


def _run_all(todo: Sequence[Experiment]) -> list[Section]:
    sections = []
    with tqdm(total=sum(one.steps for one in todo), unit="step") as bar:

        def step() -> None:
            bar.update()

        for one in todo:
            bar.set_description(one.name)
            sections.append(one.run(step))
    return sections
