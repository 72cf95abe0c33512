"""Python calls only the kernels that are made for it: a call of another one would be refused, or end the process."""

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from dropanchor_service.estimation.fleet import compiled

SERVICE = Path(__file__).parents[3] / "service"
MAKER = "dropanchor_service.estimation.fleet.compiled"
ROOTS = (SERVICE, SERVICE / "evaluation")
SOURCES = sorted(path for root in ("dropanchor_service", "evaluation") for path in (SERVICE / root).rglob("*.py"))


@functools.cache
def trees() -> dict[Path, ast.Module]:
    """Return the syntax of every file that names `estimation`, where all inner kernels are.

    Parsed while tests are collected, it would take seconds in each worker.
    """
    return {path: ast.parse(text) for path in SOURCES if "estimation" in (text := path.read_text())}


def module_of(path: Path) -> str:
    root = next(root for root in reversed(ROOTS) if path.is_relative_to(root))
    return ".".join(path.relative_to(root).with_suffix("").parts)


def is_kernel(function: ast.FunctionDef) -> bool:
    return any("njit" in ast.unparse(decorator) for decorator in function.decorator_list)


def inner_kernels() -> set[tuple[str, str]]:
    """Return module and name of the kernels that only kernels may call."""
    return {
        (module_of(path), node.name)
        for path, tree in trees().items()
        if any(isinstance(node, ast.ImportFrom) and node.module == MAKER for node in tree.body)
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and is_kernel(node)
        if "cache=True" not in ast.unparse(node.decorator_list[0])
    }


def names_outside_of_kernels(node: ast.AST) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef) and is_kernel(child):
            continue
        if isinstance(child, ast.Name) and isinstance(child.ctx, ast.Load):
            yield child.id
        if isinstance(child, ast.Attribute) and isinstance(child.value, ast.Name):
            yield f"{child.value.id}.{child.attr}"
        yield from names_outside_of_kernels(child)


def imported(node: ast.ImportFrom, inner: set[tuple[str, str]]) -> dict[str, tuple[str, str]]:
    """Return the inner kernels by the names that they have after an import, also of the module that they are in."""
    known = {}
    for alias in node.names:
        name, package = alias.asname or alias.name, f"{node.module}.{alias.name}"
        if (node.module, alias.name) in inner:
            known[name] = (node.module or "", alias.name)
        known |= {f"{name}.{kernel}": (module, kernel) for module, kernel in inner if module == package}
    return known


def test_python_calls_no_inner_kernel() -> None:
    inner = inner_kernels()
    assert len(inner) > 300
    called = []
    for path, tree in trees().items():
        known = {name: (module_of(path), name) for module, name in inner if module == module_of(path)}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                known |= imported(node, inner)
        called += [(path.name, known[name]) for name in names_outside_of_kernels(tree) if name in known]

    assert called == [], "give them cache=True, which makes them callable"


def test_a_call_of_an_inner_kernel_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled.Inner, "called_from_python", False)

    @compiled.njit()
    def double(x: float) -> float:
        return 2.0 * x

    @compiled.njit(cache=True)
    def quadruple(x: float) -> float:
        return double(double(x))

    assert quadruple(np.pi) == 4 * np.pi
    with pytest.raises(TypeError, match="only kernels call double"):
        double(1.0)
