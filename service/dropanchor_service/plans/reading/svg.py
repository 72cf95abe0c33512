"""Let an SVG through if it only draws: no script, no other file, nothing outside the SVG namespace."""

import re
from collections.abc import Iterator
from xml.etree import ElementTree

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.plans.reading.svg_size import size_of
from dropanchor_service.plans.reading.svg_styles import at_rest
from dropanchor_service.plans.reading.svg_weight import Scales

MAX_ELEMENTS = 200_000
NAMESPACE = "http://www.w3.org/2000/svg"
_SVG = f"{{{NAMESPACE}}}"
_HREFS = ("href", "{http://www.w3.org/1999/xlink}href")

_DRAWING = re.compile(
    "svg|g|defs|symbol|use|switch|title|desc|style|path|rect|circle|ellipse|line|polyline|polygon|text|tspan|textPath|"
    "image|linearGradient|radialGradient|stop|pattern|clipPath|mask|marker|filter|fe[A-Za-z]+"
)
_WITHOUT_EFFECT = re.compile("metadata|view|cursor|animate|animateMotion|animateTransform|set|mpath|discard")
_EMBEDDED = re.compile(r"data:image/(?:png|jpeg);base64,[A-Za-z0-9+/=\s]*")
_REFERENCE = re.compile(r"(?:url|src|image|image-set)\s*\(\s*(.{0,40})", re.IGNORECASE | re.DOTALL)


def sanitised(content: bytes) -> tuple[bytes, int, int]:
    """Return an SVG that only draws, its width and its height in pixels. Raises RefusedError."""
    try:
        root = fromstring(content, forbid_entities=True, forbid_external=True)
    except DefusedXmlException as error:
        raise RefusedError(say("svg_entities", "the SVG declares entities. Save it as plain SVG")) from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RefusedError(say("svg_damaged", "the SVG is damaged: {why}", why=said_by(error))) from error
    if root.tag != f"{_SVG}svg":
        raise RefusedError(say("svg_other", "the file is XML, but no SVG"))
    if sum(1 for _ in root.iter()) > MAX_ELEMENTS:
        raise RefusedError(
            say("svg_large", "the SVG has more than {n} elements. Save it as PNG or PDF", n=MAX_ELEMENTS)
        )
    _clean(root)
    Scales(root, {element: _name(element) for element in root.iter()}).require_bearable()
    width, height = size_of(root)
    ElementTree.register_namespace("", NAMESPACE)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True), width, height


def _clean(element: ElementTree.Element) -> None:
    """Remove what has no effect on the drawing, from the element and from all in it. Raises RefusedError."""
    for found in list(element.iter()):
        for child in list(found):
            if not child.tag.startswith(_SVG) or _WITHOUT_EFFECT.fullmatch(_name(child)):
                found.remove(child)
    for found in element.iter():
        name = _name(found)
        if not _DRAWING.fullmatch(name):
            raise RefusedError(
                say(
                    "svg_element",
                    "the SVG contains <{name}>, which is not allowed. Save it as plain SVG, PNG or PDF",
                    name=name[:40],
                )
            )
        found.attrib = dict(_kept_attributes(found))
        if name == "style":
            text = "".join(found.itertext())
            _require_local(text)
            found[:], found.text = [], at_rest(text)


def _kept_attributes(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    for name, value in element.attrib.items():
        if name in _HREFS:
            yield "href", _local_href(_name(element), value)
        elif name.lower().startswith("on"):
            raise RefusedError(
                say(
                    "svg_script",
                    "the SVG contains a script: the attribute {name}. Save it as plain SVG",
                    name=name[:40],
                )
            )
        elif not name.startswith("{"):
            _require_local(value)
            yield name, at_rest(value) if name == "style" else value


def _local_href(element: str, value: str) -> str:
    if value.strip().startswith("#") or (element == "image" and _EMBEDDED.fullmatch(value.strip())):
        return value.strip()
    raise RefusedError(
        say(
            "svg_image",
            "the SVG refers to another file: {file}. Embed its images when you save it",
            file=repr(value[:80]),
        )
    )


def _require_local(text: str) -> None:
    """Raise RefusedError for a style or an attribute that could load something."""
    if "\\" in text or "@import" in text.lower():
        raise RefusedError(say("svg_style", "the SVG has a style that may load another file. Save it as plain SVG"))
    for reference in _REFERENCE.findall(text):
        if not reference.lstrip("'\"").startswith("#"):
            raise RefusedError(
                say("svg_file", "the SVG refers to another file: {file}. Save it as plain SVG", file=repr(reference))
            )


def _name(element: ElementTree.Element) -> str:
    return str(element.tag).removeprefix(_SVG)
