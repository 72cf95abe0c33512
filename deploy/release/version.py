"""State the version of a release. It is the same for all distributions, and each file that states it is listed here.

`python -m release.version` prints it, and `python -m release.version 0.2.0` writes a new one.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
_VERSION = r"(?P<version>[0-9]+\.[0-9]+\.[0-9]+[0-9a-z.]*)"
_IN_PYPROJECT = rf'^version = "{_VERSION}"$'
_PLACES = (
    ("schemas/pyproject.toml", _IN_PYPROJECT),
    ("tag_client/pyproject.toml", _IN_PYPROJECT),
    ("tag_client/pyproject.toml", rf'"dropanchor-schemas=={_VERSION}"'),
    ("tag_client/dropanchor_tag_client/host.py", rf'^VERSION = "{_VERSION}"'),
    ("tag_client/typescript/package.json", rf'^  "version": "{_VERSION}",$'),
    ("service/pyproject.toml", _IN_PYPROJECT),
    ("service/pyproject.toml", rf'"dropanchor-schemas=={_VERSION}"'),
    ("service/pyproject.toml", rf'"dropanchor-tag-client\[[a-z,]+\]=={_VERSION}"'),
    ("service/pyproject.toml", rf'"dropanchor-evaluation=={_VERSION}"'),
    ("service/evaluation/pyproject.toml", _IN_PYPROJECT),
    ("service/evaluation/pyproject.toml", rf'"dropanchor-service=={_VERSION}"'),
)


class DisagreementError(Exception):
    """Two files state different versions."""


def stated(root: Path = ROOT) -> list[tuple[str, str]]:
    """Return every file that states the version, with what it states. Raises LookupError for one that states none."""
    return [(name, _match(root / name, pattern)["version"]) for name, pattern in _PLACES]


def version(root: Path = ROOT) -> str:
    """Return the version. Raises DisagreementError."""
    places = stated(root)
    if len({found for _, found in places}) != 1:
        raise DisagreementError("\n".join(f"{name}: {found}" for name, found in places))
    return places[0][1]


def write(new: str, root: Path = ROOT) -> None:
    """Write a new version into every file. Raises ValueError if it is none."""
    if re.fullmatch(_VERSION, new) is None:
        raise ValueError(f"{new} is no version like 1.2.3")
    for name, pattern in _PLACES:
        found = _match(root / name, pattern)
        text = found.string
        (root / name).write_text(text[: found.start("version")] + new + text[found.end("version") :], encoding="utf-8")


def _match(path: Path, pattern: str) -> re.Match[str]:
    found = re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        raise LookupError(f"{path} states no version: {pattern}")
    return found


def main(new: str | None = None) -> None:
    if new is not None:
        write(new)
    print(version())


if __name__ == "__main__":
    main(*sys.argv[1:2])
