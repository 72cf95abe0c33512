"""The page of the engine's numbers: each with its value, its unit and reason, and the rule that goes with it."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dropanchor_evaluation.ablation.rules import RULES
from dropanchor_evaluation.reference.markdown import table
from dropanchor_service.estimation import fleet
from dropanchor_service.estimation.fleet.tuning import Tuning

FOLDER: Final = Path(fleet.__file__).parent
CODES: Final = {
    *("belief/layout.py", "belief/states.py", "frontend/assembly.py", "frontend/event.py", "frontend/node.py"),
    *("frontend/ordering.py", "belief/births/forgetting.py", "belief/births/numbers.py"),
}
"""Files whose integers are codes, indices and sizes of arrays."""
TUNING: Final = "tuning.py"
ABOUT: Final = """\
# The numbers of the engine `fleet`

Every number of the engine: the fields of `Tuning`, and the constants of its modules. A rule of
`dropanchor evaluate ablate` takes out the numbers that name it; [what each rule
buys](../results/ablation.md) is measured. Indices, codes and sizes of arrays are not listed.
"""


@dataclass(frozen=True)
class Number:
    """One number. reason: its unit, and what it is for, as the comment beside it says."""

    name: str
    value: str
    reason: str
    file: str


def page() -> str:
    """Return the page."""
    found = list(numbers())
    rules = {number: rule.name for rule in RULES for number in rule.numbers}
    parts = [ABOUT, f"There are {len(found)} numbers in {len({one.file for one in found})} files.\n"]
    for file in sorted({one.file for one in found}):
        rows = [(f"`{one.name}`", one.value, one.reason, rules.get(one.name, "")) for one in found if one.file == file]
        parts += [f"## `{file}`\n", table(("number", "value", "unit and reason", "rule"), rows)]
    return "\n".join(parts)


def numbers() -> Iterator[Number]:
    """Yield the numbers of the engine, file by file."""
    for path in sorted(FOLDER.rglob("*.py")):
        file = path.relative_to(FOLDER).as_posix()
        if file not in CODES:
            yield from _numbers_of(path.read_text(encoding="utf-8"), file)


def _numbers_of(text: str, file: str) -> Iterator[Number]:
    lines = text.splitlines()
    tree = ast.parse(text)
    fields = [one for one in tree.body if isinstance(one, ast.ClassDef) and one.name == Tuning.__name__]
    for statement in [*tree.body, *(line for one in fields for line in one.body)]:
        for name, value in _values(statement):
            comment = lines[statement.lineno - 1].partition("#")[2].strip()
            if comment or not value.isdigit():  # an integer without a comment is an index
                yield Number(name, value, comment, file)


def _values(statement: ast.stmt) -> Iterator[tuple[str, str]]:
    """Yield name and value of a statement that gives names to numbers."""
    if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
        target, value = statement.targets[0], statement.value
    elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
        target, value = statement.target, statement.value
    else:
        return
    pairs = [(target, value)]
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = list(zip(target.elts, value.elts, strict=True))
    for name, number in pairs:
        if isinstance(name, ast.Name) and _is_number(number):
            yield name.id, ast.unparse(number)


def _is_number(value: ast.expr) -> bool:
    """Return whether a value is a number, or is computed from numbers and names."""
    parts = list(ast.walk(value))
    known = ast.Constant | ast.Name | ast.BinOp | ast.UnaryOp | ast.operator | ast.unaryop | ast.expr_context
    numbers = [part.value for part in parts if isinstance(part, ast.Constant)]
    only = all(isinstance(part, known) for part in parts)
    return only and bool(numbers) and all(isinstance(one, int | float) for one in numbers)
