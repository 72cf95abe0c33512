"""What the program knows of a kind of module: how to reach it, to read it, and to start its reports."""

from collections.abc import Callable
from typing import NamedTuple

from dropanchor_tag_client.sources.modules.report import Parser


class Module(NamedTuple):
    """A supported module.

    baud: as delivered. start_commands: written to a silent module, one per second. hint: what its owner can do if it
    stays silent. poll: commands that are written in turn, all the time, to a module that measures only when asked; only
    its answers tell that it is there. only_named: other boards print such lines, too, so that they tell nothing.
    """

    name: str
    baud: int
    parser: Callable[[], Parser]
    start_commands: tuple[bytes, ...]
    hint: str
    poll: tuple[bytes, ...] = ()
    only_named: bool = False


def commands(texts: list[str]) -> tuple[bytes, ...]:
    """Return what is written to a module for each of the commands."""
    return tuple(text.encode() + b"\r\n" for text in texts)
