"""Write the page with the licences of what an installation brings."""

from collections.abc import Iterable

from release.needs import Package

NAME = "LICENSES-OF-DEPENDENCIES.md"
_HEAD = """\
# Licences of what Dropanchor needs

Dropanchor is under the Apache License 2.0 (`LICENSE`). Its distributions hold no code of others: the page in the
browser, too, is all its own. An installation fetches the packages below, each with its own licence in its own
distribution. The licences are those that the packages declare; where one has several parts, its distribution says
which licence each part has. *Always* are the packages of every service; the others come with the extra that is named.

| package | tested version | licence | comes with |
|---|---|---|---|
"""


def page(packages: Iterable[Package]) -> str:
    return _HEAD + "".join(f"| {' | '.join(_cells(one))} |\n" for one in packages)


def _cells(package: Package) -> tuple[str, ...]:
    extras = ", ".join(f"`{extra}`" for extra in package.extras)
    return package.name, package.version, package.licence, extras or "always"
