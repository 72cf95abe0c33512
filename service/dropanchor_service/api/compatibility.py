"""Compare the OpenAPI document with that of the last release, and name what breaks clients.

`--check` fails if something does. `--accept REASON` writes what does into the page of breaking changes, and takes the
current document for the comparison from then on. `--release` only does the latter; it refuses breaking changes.
"""

import json
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import dropanchor_schemas
import dropanchor_service
from dropanchor_service.api.export import text
from dropanchor_service.api.surface import OPTIONAL, Surface, is_asked, surface_of

RELEASED = Path(dropanchor_schemas.__file__).parents[1] / "openapi.released.json"
PAGE = Path(dropanchor_service.__file__).parents[1] / "docs" / "reference" / "breaking-changes.md"

_ADVICE = (
    "These changes break clients. Keep what was there, or accept them with a reason:\n"
    "  python -m dropanchor_service.api.compatibility --accept 'REASON'\n"
)


def breaking_changes(before: Surface, now: Surface) -> list[str]:
    """Return a sentence for each change with which a client of the former document may fail."""
    return [*_removed(before, now), *_retyped(before, now), *_newly_required(before, now)]


def _removed(before: Surface, now: Surface) -> Iterator[str]:
    gone = [entry for entry in before if entry not in now]
    for entry in gone:
        if not any(entry != other and entry.startswith(other) for other in gone):  # else it is a part of the other
            yield f"{entry}: was removed"


def _retyped(before: Surface, now: Surface) -> Iterator[str]:
    for entry, old in before.items():
        new = now.get(entry, old)
        sent, understood = (old, new) if is_asked(entry) else (new, old)
        wrong = [kind for kind in sent if not _fits(kind, understood)]
        if wrong:
            yield f"{entry}: was {' or '.join(old)}, is {' or '.join(new)}"


def _newly_required(before: Surface, now: Surface) -> Iterator[str]:
    for entry, types in now.items():
        holder = entry.partition(" ? ")[0]
        if " < " in entry:
            holder = entry.removesuffix("[]") if entry.endswith("[]") else entry.rpartition(".")[0]
        if is_asked(entry) and entry not in before and OPTIONAL not in types and holder.strip() in before:
            yield f"{entry}: is new and required"


def _fits(kind: str, understood: list[str]) -> bool:
    """Return whether one of the types that the other side understands covers this one."""
    is_value = kind.startswith("'")
    wider = {"integer": "number"}.get(kind, "string" if is_value else "")
    return not understood or kind in understood or wider in understood or "any" in understood


def main(arguments: list[str]) -> int:
    now = surface_of(json.loads(text()))
    broken = breaking_changes(json.loads(RELEASED.read_text(encoding="utf-8")), now)
    match arguments:
        case ["--check"] | ["--release"] if broken:
            sys.stderr.write("\n".join(broken) + f"\n{_ADVICE}")
            return 1
        case ["--check"]:
            return 0
        case ["--release"]:
            _write(now)
            return 0
        case ["--accept", reason] if reason.strip():
            entry = f"\n## {datetime.now(UTC):%Y-%m-%d}\n\n{reason.strip()}\n\n" + "".join(
                f"- `{one}`\n" for one in broken
            )
            PAGE.write_text(PAGE.read_text(encoding="utf-8") + entry, encoding="utf-8")
            _write(now)
            return 0
    sys.stderr.write("usage: python -m dropanchor_service.api.compatibility --check | --release | --accept REASON\n")
    return 2


def _write(surface: Surface) -> None:
    lines = ",\n".join(f"{json.dumps(entry)}: {json.dumps(types)}" for entry, types in surface.items())
    RELEASED.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
