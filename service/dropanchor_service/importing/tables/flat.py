"""Nested values as rows: JSON objects and messages of ROS."""

from collections.abc import Iterator, Mapping
from typing import Any

MAX_ELEMENTS = 16

Flat = dict[str, Any]


def flat_rows(value: Any) -> Iterator[Flat]:
    """Yield the scalars of a value by path, as `linear_acceleration.x`. A list of objects gives one row for each.

    Longer lists of numbers, such as covariances and scans, are left out.
    """
    scalars: Flat = {}
    lists: list[tuple[str, list[Any]]] = []
    _collect(value, "", scalars, lists)
    if not lists:
        yield scalars
        return
    path, objects = max(lists, key=lambda found: len(found[1]))
    for item in objects:
        for row in flat_rows(item):
            yield scalars | {f"{path}.{name}": inner for name, inner in row.items()}


def _collect(value: Any, path: str, scalars: Flat, lists: list[tuple[str, list[Any]]]) -> None:
    fields = _fields(value)
    if fields is not None:
        for name, inner in fields.items():
            _collect(inner, f"{path}.{name}" if path else str(name), scalars, lists)
    elif isinstance(value, str | int | float | None):
        scalars[path] = value
    else:
        items = value.tolist() if hasattr(value, "tolist") else value
        if not isinstance(items, list):
            scalars[path] = items
        elif items and all(_fields(item) is not None for item in items):
            lists.append((path, items))
        elif len(items) <= MAX_ELEMENTS:
            for index, item in enumerate(items):
                _collect(item, f"{path}.{index}", scalars, lists)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """Return the fields of an object or a message, None for anything else."""
    if isinstance(value, Mapping):
        return value
    names = getattr(value, "__dataclass_fields__", None)
    return None if names is None else {name: getattr(value, name) for name in names if not name.startswith("__")}
