"""Tables of measured figures in the documentation. A command writes them, and a check detects those that people edit.

A table stands between two markers in a Markdown file. Its last line says when, where and at which commit it was
measured. The first marker holds two digests. That of the table shows an edit by hand. That of the sources which the
table measures shows that the table is older than they are: the page of results lists such tables. Comments, docstrings
and formatting do not count.

The line `<!-- place for NAME -->` is where a table goes that nobody has measured yet.

`python -m dropanchor_evaluation.results --check` checks every page in `service/docs/results`.
"""

import ast
import hashlib
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

_BLOCK = re.compile(
    r"<!-- results (?P<name>[\w-]+)(?P<facts>[^>]*) -->\n(?P<text>.*?)<!-- end (?P=name) -->\n", re.DOTALL
)
_PLACE = re.compile(r"<!-- place for (?P<name>[\w-]+) -->\n")
_FACT = re.compile(r'(\w+)="([^"]*)"')
_DIGITS = 16
_CODE = (".py", ".js", ".css", ".html", ".c", ".h")

ROOT = Path(__file__).parents[3]
PAGES = ROOT / "service" / "docs" / "results"


class NoPlaceError(LookupError):
    """The page has no place for a table of this name."""


@dataclass(frozen=True)
class Measured:
    """What a table measures. sources: files or folders of code, relative to the root of the project."""

    sources: Sequence[str]
    seeds: str = ""


def require_place(page: Path, name: str) -> re.Match[str]:
    """Return where the table of this name is or goes. Raises NoPlaceError, OSError."""
    text = page.read_text(encoding="utf-8")
    for found in (*_BLOCK.finditer(text), *_PLACE.finditer(text)):
        if found["name"] == name:
            return found
    raise NoPlaceError(f"{page.name} has no place for {name}: add the line <!-- place for {name} -->")


def write(root: Path, page: Path, name: str, text: str, measured: Measured) -> None:
    """Put `text` between the markers of `name` in the page. Raises NoPlaceError, OSError."""
    found = require_place(page, name)
    body = f"\n{text.strip()}\n\n{_sentence(root, measured)}\n\n"
    facts = {
        "seeds": measured.seeds,
        "measures": " ".join(measured.sources),
        "sources": sources_digest(root, measured.sources),
        "table": _digest(body),
    }
    head = " ".join(f'{key}="{value}"' for key, value in facts.items())
    block = f"<!-- results {name} {head} -->\n{body}<!-- end {name} -->\n"
    page.write_text(found.string[: found.start()] + block + found.string[found.end() :], encoding="utf-8")


def problems(root: Path, pages: Sequence[Path]) -> Iterator[str]:
    """Yield a message for each table that was never measured, or was edited by hand."""
    for page in pages:
        for name, facts, text in _blocks(page):
            place = f"{page.relative_to(root)}, {name}"
            if "table" not in facts:
                yield f"{place}: nothing has been measured yet"
            elif facts["table"] != _digest(text):
                yield f"{place}: the table was edited by hand; measure it again"


def older(root: Path, page: Path) -> Sequence[str]:
    """Return the names of the tables of a page whose sources have changed since they were measured."""
    return [
        name
        for name, facts, _ in _blocks(page)
        if "table" in facts and facts["sources"] != sources_digest(root, facts["measures"].split())
    ]


def _blocks(page: Path) -> Iterator[tuple[str, dict[str, str], str]]:
    """Yield the name, the facts and the text of each table."""
    for block in _BLOCK.finditer(page.read_text(encoding="utf-8")):
        yield block["name"], dict(_FACT.findall(block["facts"])), block["text"]


def sources_digest(root: Path, sources: Sequence[str]) -> str:
    """Return a digest of the code in these files and folders, without comments and docstrings of Python."""
    digest = hashlib.sha256()
    for source in sources:
        path = root / source
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.suffix in _CODE and file.is_file():
                digest.update(file.relative_to(root).as_posix().encode())
                digest.update(_code(file).encode())
    return digest.hexdigest()[:_DIGITS]


def _code(file: Path) -> str:
    text = file.read_text(encoding="utf-8")
    return _of_python(text) if file.suffix == ".py" else text


@cache  # many tables measure the same files
def _of_python(text: str) -> str:
    return ast.dump(_without_docstrings(ast.parse(text)))


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and body and _is_text(body[0]):
            node.body = body[1:]
    return tree


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def _sentence(root: Path, measured: Measured) -> str:
    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    seeds = f", seeds {measured.seeds}" if measured.seeds else ""
    cores = f"{os.cpu_count()} cores of {_processor()}"
    return f"Measured {when} at commit {commit(root)}{seeds}, Python {platform.python_version()}, {cores}."


def commit(root: Path) -> str:
    """Return the short hash of the commit, with a plus if the tree has changes; "unknown" outside of git."""
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return described.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def main(arguments: list[str]) -> int:
    """Return 1 and print a sentence for each table with a problem, 2 for other arguments than --check."""
    if arguments != ["--check"]:
        sys.stderr.write("usage: python -m dropanchor_evaluation.results --check\n")
        return 2
    found = list(problems(ROOT, sorted(PAGES.glob("*.md"))))
    sys.stderr.writelines(f"{problem}\n" for problem in found)
    if found:
        sys.stderr.write("service/docs/results/README.md names the command that measures each page\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
