"""Read modules that are patterns from TOML files: those of the package, and those of its users."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dropanchor_tag_client.sources.modules.module import Module, commands
from dropanchor_tag_client.sources.modules.patterns.fields import PatternError
from dropanchor_tag_client.sources.modules.patterns.parser import Pattern, Patterns, pattern

_BAUD = 115_200
_HINT = "Is an anchor on, and is --baud right?"


def module_of_file(path: Path) -> Module:
    """Return the module that a file describes, which is called after the file. Raises ValueError."""
    try:
        given = tomllib.loads(path.read_text())
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{path} is not TOML: {error}") from error
    for key, value in given.items():
        if key not in _KEYS:
            raise ValueError(f'{path}: there is no key "{key}"; known are {", ".join(_KEYS)}')
        is_right, expected = _KEYS[key]
        if key != "patterns" and not is_right(value):
            raise ValueError(f"{path}: {key} is {value!r}, {expected} was expected")
    if not _are_texts(given.get("patterns")) or not given["patterns"]:
        raise ValueError(f'{path}: patterns is missing or no list of texts: patterns = ["an{{anchor}}:{{range:m}}m"]')
    return _module(path, given)


def module_of_patterns(texts: list[str]) -> Module:
    """Return a module without a name of its own. Raises ValueError."""
    return Module("the module of --pattern", _BAUD, _parser(_checked(texts, "--pattern")), (), _HINT)


def _module(path: Path, given: dict[str, Any]) -> Module:
    ignore, start, poll = (given.get(key, []) for key in ("ignore", "start", "poll"))
    repeats, only_named = (given.get(key, False) for key in ("repeats", "only_named"))
    baud, hint = given.get("baud", _BAUD), given.get("hint", _HINT)
    parser = _parser(_checked(given["patterns"], str(path)), tuple(ignore), repeats)
    return Module(path.stem, baud, parser, commands(start), hint, commands(poll), only_named)


def _parser(
    patterns: list[Pattern], ignored: tuple[str, ...] = (), is_repeating: bool = False
) -> Callable[[], Patterns]:
    return lambda: Patterns(patterns, ignored, is_repeating=is_repeating)


def _checked(texts: list[str], source: str) -> list[Pattern]:
    try:
        return [pattern(text) for text in texts]
    except PatternError as error:
        raise ValueError(f"{source}: {error}") from error


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


_TEXTS, _SWITCH = (_are_texts, "a list of texts"), (lambda value: isinstance(value, bool), "true or false")
_KEYS: dict[str, tuple[Callable[[Any], bool], str]] = {
    **dict.fromkeys(("patterns", "ignore", "start", "poll"), _TEXTS),
    **dict.fromkeys(("repeats", "only_named"), _SWITCH),
    "baud": (lambda value: type(value) is int and value > 0, "a whole number such as 115200"),
    "hint": (lambda value: isinstance(value, str), "a text"),
}
"""What the value of each key has to be, and that in words."""
