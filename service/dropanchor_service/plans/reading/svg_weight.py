"""How much an SVG draws once everything that it repeats is counted. A few lines can stand for a billion shapes.

The unit is a plain shape. An element weighs as many as it repeats: the target of a `use`, the content of patterns,
masks, clip paths and markers, the steps of filters. Where it is not clear how far a style reaches, it counts for more.
"""

import re
from base64 import b64decode
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from dropanchor_schemas.sentences import say
from dropanchor_service.plans.reading.file_types import file_type_of
from dropanchor_service.plans.reading.raster import open_image
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.plans.reading.svg_dashes import DASHES, MOST_DASHES, dashes_of, length_of
from dropanchor_service.plans.reading.svg_styles import LAYERS, Declaration, Sheet, declarations_of, matters

MAX_WEIGHT = 200_000
MAX_DEPTH = 100  # of elements in elements, and of references to references

_CHARACTERS = 400  # of the geometry of a path, which weigh as much as a shape
_GLYPHS = 10
_DASHES = 50
_PER_MEGAPIXEL = 500
_LAYER = 100  # an image of its own, such as a group with an opacity has it
_FILTER_STEP = 1000
_PER_FILTER_PIXEL = ("numOctaves", "order", "radius")
_MOST = 1e12  # so that sums and products stay finite
_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_REFERENCE = re.compile(r"""url\(\s*(?:"#([^"]*)"|'#([^']*)'|#([^)\s]*))""", re.IGNORECASE)
_CHEAP = ("linearGradient", "radialGradient", "stop", "style", "title", "desc")
_INHERITED = ("fill", "stroke", "marker", "marker-start", "marker-mid", "marker-end")


class _Weight(NamedTuple):
    """What an element draws, how deep elements and references are nested in it, and how long the outlines are."""

    shapes: float
    depth: int
    length: float = 0.0


class Scales:
    """Weighs the elements of one drawing."""

    def __init__(self, root: Element, names: dict[Element, str]) -> None:
        """names: of all elements, without their namespace."""
        self._names = names
        self._by_id: dict[str, list[Element]] = defaultdict(list)
        for element in names:
            self._by_id[element.get("id", "")].append(element)
        self._sheet = Sheet("".join(element.itertext()) for element in names if names[element] == "style")
        self._has_dashes = any(DASHES in text for element in names for text in _styles_of(element))
        self._has_markers = any(name == "marker" for name in names.values())
        self._known: dict[Element, _Weight | None] = {}
        self._root = root

    def require_bearable(self) -> None:
        """Raise RefusedError for a drawing that a page could not show."""
        if self._weight(self._root, 0).shapes > MAX_WEIGHT:
            raise RefusedError(
                say(
                    "svg_weight",
                    "the SVG draws more than {n} shapes once all that it repeats is counted (use, pattern, "
                    "mask, marker, filter). Save it as PNG or PDF",
                    n=MAX_WEIGHT,
                )
            )

    def _weight(self, element: Element, depth: int) -> _Weight:
        """Return the weight of an element. One that refers to itself is not drawn again. Raises RefusedError."""
        if element in self._known:
            return self._known[element] or _Weight(0, 0)
        if depth > MAX_DEPTH:
            raise _too_deep()
        self._known[element] = None
        within = [self._weight(one, depth + 1) for one in (*element, *self._repeated(element))]
        inherited, added = self._styled(element, depth)
        depth_within = max((weight.depth for weight in (*within, *inherited, *added)), default=0)
        if depth_within >= MAX_DEPTH:
            raise _too_deep()
        drawn = self._own(element) + _sum(within)
        length = length_of(element) + sum(weight.length for weight in within) if self._has_dashes else 0.0
        shapes = drawn * (1 + _sum(inherited)) + _sum(added) + self._dashes(element, length, drawn)
        found = self._known[element] = _Weight(min(shapes, _MOST), 1 + depth_within, min(length, _MOST))
        return found

    def _dashes(self, element: Element, length: float, drawn: float) -> float:
        """Return what the dashes of outlines of this length weigh, on so many shapes."""
        if not length:
            return 0.0
        styles = [value for name, value in (*self._declarations(element), *self._sheet.of_all) if name == DASHES]
        return sum(min(dashes_of(value, length), drawn * MOST_DASHES) for value in styles) / _DASHES

    def _own(self, element: Element) -> float:
        """Return what an element weighs without all that it contains and repeats."""
        name = self._names[element]
        if name in _CHEAP:
            return 0.0
        if name.startswith("fe"):
            return _FILTER_STEP * _numbers(element)
        if name == "image":
            return 1 + _PER_MEGAPIXEL * _megapixels(element)
        geometry = len(element.get("d", "")) + len(element.get("points", ""))
        text = len((element.text or "").strip()) + len((element.tail or "").strip())
        weight = 1 + geometry / _CHARACTERS + text / _GLYPHS
        return weight + geometry / 2 if self._has_markers else weight  # a marker is drawn at every vertex

    def _repeated(self, element: Element) -> list[Element]:
        href = element.get("href")
        return [] if href is None or self._names[element] == "image" else self._targets(href.removeprefix("#"))

    def _styled(self, element: Element, depth: int) -> tuple[list[_Weight], list[_Weight]]:
        """Return the weights that the style of an element adds to every shape in it, and those that it adds once."""
        inherited: list[_Weight] = []
        added: list[_Weight] = []
        for name, value in self._declarations(element):
            (inherited if name in _INHERITED else added).extend(self._of_value(element, name, value, depth))
        for name, value in self._sheet.of_all:
            added.extend(self._of_value(element, name, value, depth))
        return inherited, added

    def _declarations(self, element: Element) -> Iterator[Declaration]:
        yield from (one for one in element.attrib.items() if one[0] != "style" and matters(*one))
        yield from declarations_of(element.get("style", ""))
        yield from self._sheet.of(element, self._names[element])

    def _of_value(self, element: Element, name: str, value: str, depth: int) -> list[_Weight]:
        """Return what a value of a property refers to, and what a layer or a function of a filter costs."""
        names = ["".join(found) for found in _REFERENCE.findall(value)] if "#" in value else []
        weights = [self._weight(target, depth + 1) for one in names for target in self._targets(one)]
        if name.startswith("mask") and names:
            weights.append(_Weight(_LAYER / 4, 1))
        if name in LAYERS and len(element) and value.strip() not in ("1", "normal", "auto"):
            weights.append(_Weight(_LAYER, 1))
        if name.endswith("filter"):
            weights.append(_Weight(_FILTER_STEP * value.count("("), 1))
        return weights

    def _targets(self, name: str) -> list[Element]:
        """Return the elements with an id. Of several, a browser takes the first; here all count."""
        names = {name, unquote(name)} - {""}
        return [element for one in names for element in self._by_id.get(one, ())]


def _styles_of(element: Element) -> tuple[str, ...]:
    """Return where an element may hold a style, of itself or of others."""
    return (*element.attrib, element.get("style", ""), element.text or "")


def _sum(weights: list[_Weight]) -> float:
    return sum(weight.shapes for weight in weights)


def _numbers(element: Element) -> float:
    """Return by how much the numbers of a step of a filter multiply its work."""
    product = 1.0
    for name in _PER_FILTER_PIXEL:
        for number in _NUMBER.findall(element.get(name, "")):
            product *= min(max(1.0, float(number)), _MOST)
    return min(product, _MOST)


def _megapixels(element: Element) -> float:
    """Return the size of an embedded image. Raises RefusedError for one that is damaged or too large."""
    kind, _, data = element.get("href", "").partition(";base64,")
    if not data:
        return 0.0
    media_type = kind.strip().removeprefix("data:")
    try:
        content = b64decode(data)
        file_type_of(content, media_type)
    except (ValueError, RefusedError) as error:
        raise RefusedError(
            say("svg_embedded", "an image in the SVG is damaged, or not of its type. Save it as PNG or PDF")
        ) from error
    width, height = open_image(content, media_type).size
    return width * height / 1e6


def _too_deep() -> RefusedError:
    return RefusedError(say("svg_deep", "the SVG is nested more than {n} deep. Save it as PNG or PDF", n=MAX_DEPTH))
