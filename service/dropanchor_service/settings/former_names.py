"""Settings that have a new name. The former one is understood for one more version, with a warning in the log."""

import logging
from collections.abc import Iterator, Mapping
from typing import Any

_log = logging.getLogger(__name__)

ANY = "*"
FORMER: dict[tuple[str, ...], str] = {
    ("unproven_tags",): "max_unconfirmed_tags",
    ("sites", ANY, "unproven_tags"): "max_unconfirmed_tags",
    ("history", "most_mib"): "max_mib",
    ("recording", "most_mib"): "max_mib",
    ("events", "most_mib"): "max_mib",
}
"""Where a setting had its former name, and what it is called now. `*`: in each table there."""


def with_present_names(source: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings with the present names. source: where they are from, for the log.

    If both names are given, the present one holds.
    """
    renamed = _copy(settings)
    for path, name in FORMER.items():
        for where, table in _tables(renamed, path[:-1]):
            if path[-1] in table:
                value = table.pop(path[-1])
                table.setdefault(name, value)
                former = ".".join([*where, path[-1]])
                _log.warning(
                    "%s: %s is called %s now; the former name ends with the next version", source, former, name
                )
    return renamed


def _copy(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {key: _copy(one) if isinstance(one, Mapping) else one for key, one in settings.items()}


def _tables(table: Any, path: tuple[str, ...], where: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield each table at a path, and its keys."""
    if not isinstance(table, dict):
        return
    if not path:
        yield where, table
        return
    for key in list(table) if path[0] == ANY else [path[0]]:
        yield from _tables(table.get(key), path[1:], (*where, key))
