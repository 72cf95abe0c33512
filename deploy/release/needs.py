"""List the packages that an installation brings, in the versions that constraints.txt names."""

import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, distribution
from typing import Any

from cyclonedx.spdx import is_expression, is_supported_id
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from release.staging import FOLDERS
from release.version import ROOT

_MIT = "Permission is hereby granted, free of charge, to any person obtaining a copy of this software"
_LONGEST_LICENCE = 60  # in "License"; some packages put the whole text there


class OtherVersionError(Exception):
    """A package is installed in another version than constraints.txt names."""


@dataclass(frozen=True)
class Package:
    """A package of somebody else.

    licence: as the package declares it. needs: names of the packages that it needs. extras: those extras of ours that
    bring it; none if every installation of the service has it.
    """

    name: str
    version: str
    licence: str
    needs: frozenset[str]
    extras: tuple[str, ...]


def packages() -> list[Package]:
    """Return what the service needs, and its and the tag client's extras. Raises OtherVersionError."""
    always = _closure([("dropanchor-service", "")])
    of_extras = {f"{name}[{extra}]": _closure([(name, extra)]) for name, extra in _extras()}
    needs: dict[str, set[str]] = {}
    for found in (always, *of_extras.values()):
        for name, needed in found.items():
            needs.setdefault(name, set()).update(needed)
    return [
        _package(name, needs[name], [] if name in always else [key for key in of_extras if name in of_extras[key]])
        for name in sorted(needs)
        if name not in own()
    ]


@cache
def own() -> dict[str, Any]:
    """Return the table `project` of each of our distributions, by its name."""
    files = [ROOT / folder / "pyproject.toml" for folder in FOLDERS]
    projects = [tomllib.loads(file.read_text(encoding="utf-8"))["project"] for file in files]
    return {project["name"]: project for project in projects}


@cache
def pins() -> dict[str, str]:
    """Return the tested version of each package."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").split()
    return {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}


def _extras() -> Iterator[tuple[str, str]]:
    return ((name, extra) for name, project in own().items() for extra in project.get("optional-dependencies", {}))


def _closure(roots: Iterable[tuple[str, str]]) -> dict[str, set[str]]:
    """Return all packages that these need, each with those that it names itself. roots: (package, extra or "")."""
    waiting, seen = list(roots), set[tuple[str, str]]()
    found: dict[str, set[str]] = {}
    while waiting:
        name, extra = waiting.pop()
        if (name, extra) in seen:
            continue
        seen.add((name, extra))
        needs = found.setdefault(name, set())
        for requirement in _requirements(name, extra):
            needed = str(canonicalize_name(requirement.name))
            needs.add(needed)
            waiting += [(needed, one) for one in ("", *sorted(requirement.extras))]
    return found


def _requirements(name: str, extra: str) -> list[Requirement]:
    if name in own():
        project = own()[name]
        return [
            Requirement(line)
            for line in (project["optional-dependencies"][extra] if extra else project["dependencies"])
        ]
    lines = map(Requirement, distribution(name).requires or [])
    return [one for one in lines if (one.marker.evaluate({"extra": extra}) if one.marker else not extra)]


def _package(name: str, needs: set[str], extras: list[str]) -> Package:
    found = distribution(name)
    if found.version != pins().get(name):
        raise OtherVersionError(f"{name} {found.version} is installed, and constraints.txt names {pins().get(name)}")
    return Package(name, found.version, _licence(found), frozenset(needs), tuple(extras))


def _licence(found: Distribution) -> str:
    """Return what a package declares: as SPDX where it does, else in the words of its classifiers or of a file."""
    fields = {name: found.metadata.get_all(name) or [] for name in ("License-Expression", "License", "Classifier")}
    texts = [*fields["License-Expression"], *(text for text in fields["License"] if len(text) <= _LONGEST_LICENCE)]
    as_spdx = [text for text in texts if is_supported_id(text) or is_expression(text)]
    classifiers = [line.rpartition(" :: ")[2] for line in fields["Classifier"] if line.startswith("License ::")]
    declared = next(iter(as_spdx), "") or ", ".join(classifiers) or next(iter(texts), "")
    return declared or ("MIT" if _MIT in _text_of(found) else "see the package")


def _text_of(found: Distribution) -> str:
    """Return the licence that a package brings as a file, on one line."""
    files = (found.read_text(f"licenses/{name}") for name in found.metadata.get_all("License-File") or [])
    return " ".join(" ".join(text.split()) for text in files if text)
