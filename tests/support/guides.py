"""Follow the blocks of a how-to guide word for word; only the address of the service is another one."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from support.service import ROOT, environment

GUIDES = ROOT / "service" / "docs" / "how-to"
ADDRESS = "http://127.0.0.1:8080"  # of the service, as all guides write it
TIMEOUT_S = 300.0

_BLOCK = re.compile(r"^(?P<before>[^\n]*)\n+```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"`([\w.-]+)`:$")


@dataclass(frozen=True)
class Block:
    """A block of a guide. file: what the line before it says to save it as; empty for commands."""

    language: str
    text: str
    file: str


def blocks_of(guide: str, heading: str) -> list[Block]:
    """Return the blocks below a heading, up to the next heading; those above all headings if it is empty."""
    text = (GUIDES / guide).read_text()
    below = (text.split(f"\n## {heading}\n", 1)[1] if heading else text).split("\n## ", 1)[0]
    return [
        Block(found["language"], found["text"], name[1] if (name := _FILE.search(found["before"])) else "")
        for found in _BLOCK.finditer(below)
    ]


def follow(blocks: list[Block], folder: Path, url: str) -> str:
    """Save the files, run the commands in order, and return what they print. Fails when a command does."""
    said = []
    for block in blocks:
        text = block.text.replace(ADDRESS, url)
        if block.file:
            (folder / block.file).write_text(text)
        elif block.language == "sh":
            said.append(run(text, folder))
    return "".join(said)


def run(script: str, folder: Path, **variables: str) -> str:
    """Run a script of the shell in a folder, with these variables, and return what it prints. Fails when it does.

    What mypy knows of installed packages is kept: to check them takes longer than the rest of its guide.
    """
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-euc", script],
        cwd=folder,
        env=environment(PATH=programs, MYPY_CACHE_DIR=str(ROOT / ".mypy_cache" / "guides"), **variables),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, f"{script}\n{done.stdout}\n{done.stderr}"
    return done.stdout
