"""The styles of an SVG, as far as they say what is drawn more than once."""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from xml.etree.ElementTree import Element

from dropanchor_schemas.sentences import say
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.plans.reading.svg_dashes import DASHES

Declaration = tuple[str, str]
"""A property and its value."""

LAYERS = ("opacity", "mix-blend-mode", "isolation")
"""Properties with which what an element contains is drawn into an image of its own."""

_HEAVY = ("filter", DASHES, *LAYERS)
_MATTERS = re.compile("|".join((*_HEAVY, r"url\(")), re.IGNORECASE)
_COMMENT = re.compile(r"/\*.*?(?:\*/|$)", re.DOTALL)
_RULE = re.compile(r"([^{};]*)\{([^{}]*)\}")
_COMBINATOR = re.compile(r"[\s>+~]+")
_SIMPLE = re.compile(r"([\w-]*)((?:[.#][\w-]+)*)")
_MOVING = re.compile(r"(?:-webkit-)?(?:animation|transition)[\w-]*\s*:[^;}]*;?", re.IGNORECASE)
_MOVES = re.compile("animation|transition", re.IGNORECASE)
_VARIABLE = re.compile(r"--[^\s:;{}]*\s*:[^;}]*url\(", re.IGNORECASE)


def at_rest(style: str) -> str:
    """Return a style without its animations. Raises RefusedError for a variable that refers to an element."""
    text = _COMMENT.sub(" ", style) if "/*" in style else style
    text = _MOVING.sub("", text) if _MOVES.search(text) else text
    if _VARIABLE.search(text):
        raise RefusedError(
            say("svg_variables", "the SVG has a style with variables that refer to elements. Save it as PNG or PDF")
        )
    return text


def declarations_of(style: str) -> list[Declaration]:
    """Return the declarations of a style that can make a drawing heavier."""
    if not _MATTERS.search(style):
        return []
    parts = (part.partition(":") for part in style.split(";"))
    named = ((name.strip().lower(), value.strip()) for name, _, value in parts)
    return [(name, value) for name, value in named if matters(name, value)]


def matters(name: str, value: str) -> bool:
    """Return whether a property can make a drawing heavier."""
    return "url(" in value.lower() or name.endswith(_HEAVY)


class Sheet:
    """The rules of all style elements. of_all: what may apply to every element."""

    def __init__(self, styles: Iterable[str]) -> None:
        self.of_all: list[Declaration] = []
        self._of_some: dict[str, list[Declaration]] = defaultdict(list)
        for style in styles:
            for selectors, body in _RULE.findall(style):
                self._add(selectors, declarations_of(body))
            self.of_all += declarations_of(_RULE.sub("", style).replace("}", ";"))
        self.of_all = list(dict.fromkeys(self.of_all))

    def of(self, element: Element, name: str) -> Iterator[Declaration]:
        """Yield what the rules for the classes, the id or the name of an element say."""
        keys = [*(f".{one}" for one in element.get("class", "").split()), f"#{element.get('id')}", name]
        for key in keys if self._of_some else ():
            yield from self._of_some.get(key, ())

    def _add(self, selectors: str, declarations: list[Declaration]) -> None:
        for selector in selectors.split(",") if declarations else ():
            simple = _SIMPLE.fullmatch(_COMBINATOR.split(selector.strip())[-1])
            if simple is None or not simple[0]:  # such as :not(.a), which is for others
                self.of_all += declarations
            else:
                first = re.match(r"[.#][\w-]+", simple[2])
                self._of_some[first[0] if first else simple[1]] += declarations
