"""One file for a program of the pages and all the modules that it imports.

The map has some 140 small modules. A browser would fetch each by itself, one round trip after another along the chain
of imports: seconds on a slow network. Here each module becomes a function of one file, in the order in which a browser
would run them. The modules can still be fetched one by one.
"""

import os
import re
from pathlib import Path

PROGRAMS = frozenset(
    {
        "page/main.js",
        "sites/page.js",
        "tag/page.js",
        "data/track_worker.js",
        "basemap/worker.js",
        "i18n/de/messages.js",
        "i18n/en/messages.js",
    }
)
"""What a page, a worker or a computed `import()` asks for."""

_COMMENT = re.compile(r"/\*\*.*?\*/", re.DOTALL)  # its types look like imports
_IMPORT = re.compile(r'^import (?:\{ (?P<names>[^}]+) \}|(?P<default>\w+)) from "(?P<path>[^"]+)";$', re.MULTILINE)
_LATER_IMPORT = re.compile(r'\bimport\("(?P<path>[^"]+)"\)')
_EXPORT = re.compile(r"^export (?=(?:(?:async )?function\*? |class |const )(?P<name>[\w$]+))", re.MULTILINE)
_EXPORT_LIST = re.compile(r"^export \{ (?P<names>[^}]+) \};$", re.MULTILINE)
_EXPORT_DEFAULT = re.compile(r"^export default ", re.MULTILINE)
_UNREAD = re.compile(r"^(?:import|export)\b.*", re.MULTILINE)
_AWAITS = re.compile(r"^\S.*\bawait\b", re.MULTILINE)  # outside a function, which would be indented


class BundleError(Exception):
    """The modules cannot become one file. The message says which of them is in the way."""


def bundle(folder: Path, program: str) -> str:
    """Return the JavaScript of a program with its modules. program: its path in folder.

    Raises BundleError for imports in a circle, and for a form of import or export that the pages do not use.
    """
    return _Bundle(folder, program).text()


def last_change(folder: Path) -> int:
    """Return when a module in folder was last changed, in ns."""
    return max(
        os.stat(os.path.join(place, name)).st_mtime_ns
        for place, _, names in os.walk(folder)
        for name in names
        if name.endswith(".js")
    )


class _Bundle:
    def __init__(self, folder: Path, program: str) -> None:
        self._folder = folder
        self._program = program
        self._parts: list[str] = []
        self._variables: dict[str, str] = {}
        """The variable that holds the exports of a module, by the module's path."""
        self._unfinished: list[str] = []

    def text(self) -> str:
        variable = self._add(self._program)
        exports = f"export default {variable}.default;" if "const $default = " in self._parts[-1] else ""
        return "\n".join([*self._parts, exports])

    def _add(self, path: str) -> str:
        """Add a module after those that it imports, unless it is there. Return its variable."""
        if path in self._unfinished:
            raise BundleError(f"these modules import each other in a circle: {[*self._unfinished, path]}")
        if path not in self._variables:
            self._unfinished.append(path)
            source = (self._folder / path).read_text("utf-8")
            part = self._part(path, _COMMENT.sub(lambda comment: "\n" * comment[0].count("\n"), source))
            self._unfinished.pop()
            self._variables[path] = f"${len(self._variables)}"
            self._parts.append(f"// {path}\nconst {self._variables[path]} = {part}")
        return self._variables[path]

    def _part(self, path: str, source: str) -> str:
        """Return a call that runs a module and returns its exports."""

        def imported(found: re.Match[str]) -> str:
            variable = self._add(_beside(path, found["path"]))
            names = f"default: {found['default']}" if found["default"] else found["names"].replace(" as ", ": ")
            return f"const {{ {names} }} = {variable};"

        def imported_later(found: re.Match[str]) -> str:
            return f"Promise.resolve({self._add(_beside(path, found['path']))})"

        source = _LATER_IMPORT.sub(imported_later, _IMPORT.sub(imported, source))
        exports = [found["name"] for found in _EXPORT.finditer(source)]
        exports += [found["names"] for found in _EXPORT_LIST.finditer(source)]
        exports += ["default: $default" for _ in _EXPORT_DEFAULT.finditer(source)]
        source = _EXPORT_LIST.sub("", _EXPORT.sub("", _EXPORT_DEFAULT.sub("const $default = ", source)))
        if unread := _UNREAD.search(source):
            raise BundleError(f"{path}: this form of import or export cannot be bundled: {unread[0]}")
        own_place = os.path.relpath(path, os.path.dirname(self._program))
        source = source.replace("import.meta.url", f'new URL("{own_place}", import.meta.url)')
        start = "await (async () => {" if _AWAITS.search(source) else "(() => {"
        return f"{start}{source}\nreturn {{ {', '.join(exports)} }};\n}})();"


def _beside(path: str, other: str) -> str:
    return os.path.normpath(os.path.join(os.path.dirname(path), other))
