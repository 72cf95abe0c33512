"""Make the pictures of the README: `python -m pictures`, which is `make pictures`.

With --check, warn when the page has changed since they were made.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from pictures.album import PAGE, is_outdated, record
from pictures.take import take_live, take_past
from support.browser import running_chromium
from support.kernel_cache import use_cache_of_these_sources


def main(arguments: list[str]) -> int:
    """Return 0, and 2 for other arguments than --check. An outdated picture fails nothing."""
    if arguments not in ([], ["--check"]):
        sys.stderr.write("usage: python -m pictures [--check]\n")
        return 2
    if not arguments:
        _make()
    elif is_outdated(PAGE):
        sys.stderr.write("warning: the page has changed since the pictures in the README were made: make pictures\n")
    return 0


def _make() -> None:
    use_cache_of_these_sources()
    with TemporaryDirectory() as folder, running_chromium() as chromium:
        take_live(chromium, Path(folder) / "live", PAGE.parent)
        take_past(chromium, Path(folder) / "past", PAGE.parent)
    record(PAGE)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
