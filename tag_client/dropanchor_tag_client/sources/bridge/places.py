"""What a rule takes a value from: a path in the payload, a fixed text, or a text with places such as {1}."""

import re
from contextlib import suppress
from typing import Any, NamedTuple

_PLACE = re.compile(r"\{([^{}]*)\}")
_LEVEL = re.compile(r"topic\[(\d{1,4})\]")
_PATH = re.compile(r"(?!topic(\W|$))[^\W\d][\w@$ -]*(\.[\w@$ -]+)*")
_MAX_SHOWN = 60
EACH = "[]"


class UnusableError(Exception):
    """A message lacks what a rule needs. The text says what, and goes on after the topic."""


class Element(NamedTuple):
    """What a rule looks at: a message or, with `each`, one element of a list or object in it.

    topic: of the message. wildcards: what each + of the filter stands for. around: what encloses the part, the message
    last. key: name of the element, or its index where no list around it has a name.
    """

    topic: str
    wildcards: list[str]
    around: tuple[Any, ...]
    part: Any
    key: str = ""
    is_index: bool = False

    def elements(self, path: str) -> "list[Element]":
        """Return the elements at a path: of a list or an object, or of each of several, as in `tags[].ranges`."""
        found = [self]
        for step in path.removesuffix(EACH).split(EACH):
            found = [inner for one in found for inner in one._elements(step.removeprefix("."))]
        return found

    def _elements(self, path: str) -> "list[Element]":
        value = at(self.part, path) if path else self.part
        if not isinstance(value, list | dict):
            raise UnusableError(f"the payload has no list {path}" if path else "the payload is no list")
        around = (self.part, *self.around)
        if isinstance(value, dict):
            return [self._replace(around=around, part=part, key=key, is_index=False) for key, part in value.items()]
        if self.key and not self.is_index:
            return [self._replace(around=around, part=part) for part in value]
        return [
            self._replace(around=around, part=part, key=str(index), is_index=True) for index, part in enumerate(value)
        ]

    def value(self, source: str) -> Any:
        """Return what a source names. Raises UnusableError."""
        if source.startswith("="):
            return self.text(source[1:])
        alone = _PLACE.fullmatch(source)
        if alone is not None:
            return self._placed(alone[1])
        return self.text(source) if "{" in source else at(self.part, source)

    def value_beside(self, source: str) -> Any:
        """Return what a source names in the element, or else in what encloses it. Raises UnusableError."""
        for part in (self.part, *self.around[:-1]):
            with suppress(UnusableError):
                return self._replace(part=part).value(source)
        return self._replace(part=self.around[-1]).value(source)

    def text(self, template: str) -> str:
        """Return a text with its places filled in. Raises UnusableError."""
        return _PLACE.sub(lambda place: _as_text(place[0], self._placed(place[1])), template)

    def _placed(self, name: str) -> Any:
        if name == "key":
            return self.key
        if name == "value":
            return self.part
        if name.isdecimal():
            return self.wildcards[int(name) - 1]
        level = _LEVEL.fullmatch(name)
        if level is None:
            return self._beside(name)
        levels = self.topic.split("/")
        if int(level[1]) >= len(levels):
            raise UnusableError(f"the topic has no level {level[1]}: the first one is 0")
        return levels[int(level[1])]

    def _beside(self, path: str) -> Any:
        for value in (self.part, *self.around[:-1]):
            with suppress(UnusableError):
                return at(value, path)
        return at(self.around[-1], path)


def at(value: Any, path: str) -> Any:
    """Return what a payload has at a path. Raises UnusableError."""
    if isinstance(value, dict) and path in value:  # a name may hold dots itself
        return value[path]
    for name in path.split("."):
        try:
            value = value[int(name)] if isinstance(value, list) else value[name]
        except (KeyError, IndexError, TypeError, ValueError):
            raise UnusableError(f"the payload has no {path}") from None
    return value


def shown(value: Any) -> str:
    """Return a value of a payload as it stands in a sentence."""
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}…"


def unknown_place(source: str, topic: str, has_each: bool) -> str | None:
    """Return why a source of a rule for a filter cannot be filled in, None if it can."""
    rest = _PLACE.sub("", source)
    if "{" in rest or "}" in rest:
        return f"in {source!r} a {{ or }} stands alone"
    for name in _PLACE.findall(source):
        if not _is_known(name, topic, has_each):
            return f"there is no {{{name}}}; known are {_known(topic, has_each)}"
    return None


def _is_known(name: str, topic: str, has_each: bool) -> bool:
    if name.isdecimal():
        return 1 <= int(name) <= topic.split("/").count("+")
    level = _LEVEL.fullmatch(name)
    if level is not None:
        return topic.endswith("#") or int(level[1]) < len(topic.split("/"))
    return has_each if name == "key" else _PATH.fullmatch(name) is not None


def _known(topic: str, has_each: bool) -> str:
    levels = topic.split("/")
    numbers = " ".join(f"{{{number}}}" for number in range(1, levels.count("+") + 1))
    known = [f"{numbers} (what each + stands for)"] if numbers else []
    known.append(f"{{topic[0]}} to {'…' if topic.endswith('#') else f'{{topic[{len(levels) - 1}]}}'}")
    known.append("{key} and {value} (of each)" if has_each else "{value} (the payload)")
    return f"{', '.join(known)}, and a path in the payload, such as {{device.id}}"


def _as_text(place: str, value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise UnusableError(f"{place} is {shown(value)}, a text or a number was expected")
    return str(value)
