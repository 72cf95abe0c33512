"""The samples of code in the README, the tutorial and the how-to guides, and the commands in them."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import dedent

from support.service import ROOT

_DOCS = ROOT / "service" / "docs"
_BLOCK = re.compile(r"^(?P<indent> *)```(?P<language>\w+)\n(?P<text>.*?)^(?P=indent)```$", re.MULTILINE | re.DOTALL)
_INNER = re.compile(r"\$\(([^()]*)\)")
_ENDS = {"|", "||", "&&", ";", "&"}
_PROGRAM = re.compile(r"(?:\.venv/bin/)?(?P<name>dropanchor|dropanchor-tag|curl|python|pip)")


@dataclass(frozen=True)
class Sample:
    """A block of a page. page: the name of its file."""

    page: str
    language: str
    text: str

    @property
    def name(self) -> str:
        """The page and the first line, without a comment at its end."""
        return f"{self.page}: {self.text.splitlines()[0].split('  #')[0].strip()}"


def samples(*languages: str) -> list[Sample]:
    """Return the blocks in these languages, in the order of the pages."""
    return [
        Sample(file.name, block["language"], dedent(block["text"]))
        for file in (ROOT / "README.md", _DOCS / "tutorial.md", *sorted((_DOCS / "how-to").glob("*.md")))
        for block in _BLOCK.finditer(file.read_text("utf-8"))
        if block["language"] in languages
    ]


def commands(text: str) -> Iterator[list[str]]:
    """Yield the words of each command in a shell script, also of those in `$(…)`."""
    for line in _lines(text):
        for inner in _INNER.findall(line):
            yield from commands(inner)
        lexer = shlex.shlex(_INNER.sub("0", line), posix=True, punctuation_chars="|&;<>")
        lexer.whitespace_split = True
        words: list[str] = []
        for word in lexer:
            if word in _ENDS:
                yield words
                words = []
            else:
                words.append(word)
        yield words


def called(text: str, program: str) -> list[list[str]]:
    """Return the arguments of each call of a program, up to a redirection."""
    found = []
    for words in commands(text):
        name = _PROGRAM.fullmatch(words[0]) if words else None
        if name and name["name"] == program:
            end = next((i for i, word in enumerate(words) if word in ("<", ">")), len(words))
            found.append(words[1:end])
    return found


def _lines(text: str) -> Iterator[str]:
    """Yield the logical lines: one that ends with a backslash, or within quotes, goes on."""
    pending = ""
    for line in text.splitlines():
        pending += line + "\n"
        if line.endswith("\\"):
            pending = pending.removesuffix("\\\n") + " "
            continue
        try:
            shlex.split(pending, comments=True)
        except ValueError:  # a quotation goes on in the next line
            continue
        yield pending
        pending = ""
    assert not pending.strip(), pending
