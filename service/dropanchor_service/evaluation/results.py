"""Tables of measured figures in the documentation. A command writes them, and a check detects outdated ones.

A table stands between two markers in a Markdown file. A sentence below it gives the time, the commit and the machine.
The first marker holds two digests. The digest of the table detects manual edits. The digest of the measured sources
detects tables that are older than the code; comments, docstrings and formatting do not change it.
"""

import ast
import hashlib
import os
import platform
import re
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

_BLOCK = re.compile(
    r"<!-- results (?P<name>[\w-]+)(?P<facts>[^>]*) -->\n(?P<text>.*?)<!-- end (?P=name) -->\n", re.DOTALL
)
_FACT = re.compile(r'(\w+)="([^"]*)"')
_DIGITS = 16


class NoPlaceError(LookupError):
    """The page has no markers of this name."""


@dataclass(frozen=True)
class Measured:
    """What a table measures. sources: files or folders of Python code, relative to the root of the project."""

    sources: Sequence[str]
    seeds: str = ""


def write(root: Path, page: Path, name: str, text: str, measured: Measured) -> None:
    """Write `text` between the markers of `name` in the page. Raises NoPlaceError if the page has no such markers."""
    old = page.read_text(encoding="utf-8")
    found = next((block for block in _BLOCK.finditer(old) if block["name"] == name), None)
    if found is None:
        raise NoPlaceError(f"{page.name} has no place for {name}: add <!-- results {name} --> and <!-- end {name} -->")
    body = f"\n{text.strip()}\n\n{_sentence(root, measured)}\n\n"
    facts = {
        "seeds": measured.seeds,
        "measures": " ".join(measured.sources),
        "sources": sources_digest(root, measured.sources),
        "table": _digest(body),
    }
    head = " ".join(f'{key}="{value}"' for key, value in facts.items())
    block = f"<!-- results {name} {head} -->\n{body}<!-- end {name} -->\n"
    page.write_text(old[: found.start()] + block + old[found.end() :], encoding="utf-8")


def problems(root: Path, pages: Sequence[Path]) -> Iterator[str]:
    """Yield a message for each table that was never measured, was edited by hand, or is older than its sources."""
    for page in pages:
        for block in _BLOCK.finditer(page.read_text(encoding="utf-8")):
            facts = dict(_FACT.findall(block["facts"]))
            place = f"{page.relative_to(root)}, {block['name']}"
            if "table" not in facts:
                yield f"{place}: nothing has been measured yet"
            elif facts["table"] != _digest(block["text"]):
                yield f"{place}: the table was edited by hand; measure it again"
            elif facts["sources"] != sources_digest(root, facts["measures"].split()):
                yield f"{place}: {facts['measures']} changed since; measure it again"


def sources_digest(root: Path, sources: Sequence[str]) -> str:
    """Return a digest of the code in these files and folders, without comments and docstrings."""
    digest = hashlib.sha256()
    for source in sources:
        path = root / source
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(ast.dump(_without_docstrings(ast.parse(file.read_text(encoding="utf-8")))).encode())
    return digest.hexdigest()[:_DIGITS]


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
