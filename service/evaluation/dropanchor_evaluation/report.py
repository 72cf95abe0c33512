"""Reports of experiments: sections with tables, figures and numbers, as HTML, Markdown and JSON."""

import html
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

Cell = str | float | int

STYLE = """
body { font: 16px/1.55 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222 }
h1, h2 { line-height: 1.2 } h2 { margin-top: 3rem; border-top: 1px solid #ddd; padding-top: 1.5rem }
table { border-collapse: collapse; margin: 1rem 0; font-size: .9rem } caption { text-align: left; color: #555 }
th, td { padding: .25rem .75rem; border-bottom: 1px solid #ddd; text-align: right; font-variant-numeric: tabular-nums }
th:first-child, td:first-child { text-align: left } img { max-width: 100% }
.paper { color: #555 } .finding { background: #f3f6fa; padding: .75rem 1rem; border-left: 4px solid #4a7ab5 }
"""


@dataclass(frozen=True)
class Table:
    """A table. Numbers have four significant digits; NaN is a dash."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True)
class Section:
    """One experiment. paper: the statement of the paper; finding: our own result in comparison.

    figures: by file name without extension. results: all numbers of the tables, by name.
    """

    key: str
    title: str
    paper: str
    finding: str
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()
    figures: dict[str, Figure] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)


def write_report(folder: Path, title: str, preface: Sequence[str], sections: Sequence[Section]) -> None:
    """Write report.html, report.md, results.json and the PNG figures. Create the folder if needed.

    Raises OSError if the folder is not writable.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for section in sections:
        for name, figure in section.figures.items():
            FigureCanvasAgg(figure)
            figure.savefig(folder / f"{name}.png", dpi=110, format="png", metadata={"Software": None})
    (folder / "report.md").write_text(_markdown(title, preface, sections))
    (folder / "report.html").write_text(_html(title, preface, sections))
    results = {section.key: _without_nan(section.results) for section in sections}
    (folder / "results.json").write_text(json.dumps(results, indent=1, sort_keys=True, allow_nan=False) + "\n")


def format_cell(cell: Cell) -> str:
    """Return a cell as text."""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return str(cell)
    if math.isnan(cell):
        return "–"
    return f"{cell:.4g}" if abs(cell) < 1000 else f"{cell:.0f}"


def markdown_table(table: Table) -> str:
    lines = ["| " + " | ".join(table.columns) + " |", "|" + "---|" * len(table.columns)]
    lines += ["| " + " | ".join(format_cell(cell) for cell in row) + " |" for row in table.rows]
    return "\n".join([f"*{table.caption}*", "", *lines])


def markdown_section(section: Section) -> str:
    """Return the section's sentences and tables, without its heading and figures."""
    said = [f"**The paper:** {section.paper}", f"**Here:** {section.finding}", *section.text]
    return "\n\n".join([*said, *(markdown_table(table) for table in section.tables)])


def _markdown(title: str, preface: Sequence[str], sections: Sequence[Section]) -> str:
    parts = [f"# {title}", *preface]
    for section in sections:
        parts += [f"## {section.title}", markdown_section(section)]
        parts += [f"![{name}]({name}.png)" for name in section.figures]
    return "\n\n".join(parts) + "\n"


def _html(title: str, preface: Sequence[str], sections: Sequence[Section]) -> str:
    body = [f"<h1>{html.escape(title)}</h1>", *(f"<p>{html.escape(text)}</p>" for text in preface)]
    for section in sections:
        body += [
            f'<h2 id="{section.key}">{html.escape(section.title)}</h2>',
            f'<p class="paper"><b>The paper:</b> {html.escape(section.paper)}</p>',
            f'<p class="finding"><b>Here:</b> {html.escape(section.finding)}</p>',
            *(f"<p>{html.escape(text)}</p>" for text in section.text),
            *(_html_table(table) for table in section.tables),
            *(f'<img src="{name}.png" alt="{html.escape(name)}">' for name in section.figures),
        ]
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>' + "\n".join(body) + "</body></html>\n"


def _html_table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in table.columns)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(format_cell(cell))}</td>" for cell in row) + "</tr>" for row in table.rows
    )
    return f"<table><caption>{html.escape(table.caption)}</caption><tr>{head}</tr>{rows}</table>"


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
