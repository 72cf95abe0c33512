"""A drawing that a few lines make heavy is refused when it is uploaded, whatever it repeats its shapes with."""

from base64 import b64encode
from collections.abc import Callable

import pytest

from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.plans.reading.svg import sanitised
from support.plan_files import image_file, svg_file

RECTS = "<rect/>" * 1000


def tenfold(container: str, shape: Callable[[int], str]) -> str:
    """Return containers of which each draws the one before it ten times. The last one draws 10^11 shapes."""
    made = [f"<{container} id='a0'><rect/></{container}>"]
    made += [f"<{container} id='a{i}'>{shape(i - 1) * 10}</{container}>" for i in range(1, 12)]
    return "".join(made) + shape(11)


def classes(properties: str) -> str:
    rules = "".join(f".c{i}{{{properties.format(i)}}}" for i in range(12))
    return f"<style>{rules}</style>"


HEAVY = {
    "use": tenfold("g", lambda i: f"<use href='#a{i}'/>"),
    "use of symbols": tenfold("symbol", lambda i: f"<use href='#a{i}'/>"),
    "use of nested drawings": tenfold("svg", lambda i: f"<use href='#a{i}'/>"),
    "use in definitions": "<defs>" + tenfold("g", lambda i: f"<use href='#a{i}'/>") + "</defs>",
    "escaped use": tenfold("g", lambda i: f"<use href='#%61{i}'/>"),
    "pattern": tenfold("pattern", lambda i: f"<rect fill='url(#a{i})'/>"),
    "quoted pattern": tenfold("pattern", lambda i: f"<rect style='stroke: url( &quot;#a{i}&quot; )'/>"),
    "inherited patterns": tenfold("pattern", lambda i: f"<pattern href='#a{i}'/><rect fill='url(#a{i})'/>"),
    "mask": tenfold("mask", lambda i: f"<rect mask='url(#a{i})'/>"),
    "clip path": tenfold("clipPath", lambda i: f"<rect style='clip-path:url(#a{i})'/>"),
    "class": classes("fill:url(#a{})") + tenfold("pattern", lambda i: f"<rect class='b c{i}'/>"),
    "class in a media query": f"<style>@media all{{.a{{fill:url(#p)}}}}</style><pattern id='p'>{RECTS}</pattern>"
    f"<g class='a'>{RECTS}</g>",
    "rule for all": f"<style>*{{fill:url(#p)}}</style><pattern id='p'>{RECTS}</pattern>{RECTS}",
    "rule for others": f"<style>:not(.a){{fill:url(#p)}}</style><pattern id='p'>{RECTS}</pattern>{RECTS}",
    "inherited fill": f"<pattern id='p'>{RECTS}</pattern><g fill='url(#p)'>{RECTS}</g>",
    "several elements with one id": f"<g id='a'/><g id='a'>{RECTS}</g>" + "<use href='#a'/>" * 1000,
    "marker": f"<marker id='m'>{RECTS}</marker><path marker-mid='url(#m)' d='{'L1 2' * 1000}'/>",
    "long path": f"<path id='p' d='M0 0{'L1 2' * 100_000}'/>" + "<use href='#p'/>" * 300,
    "long text": f"<text id='t'>{'x' * 100_000}</text>" + "<use href='#t'/>" * 100,
    "filter": "<filter id='f'><feGaussianBlur/></filter>" + "<rect filter='url(#f)'/>" * 300,
    "filter of CSS": "<g style='filter: blur(5px)'><rect/></g>" * 300,
    "noise": "<filter id='f'><feTurbulence numOctaves='100000'/></filter><rect filter='url(#f)'/>",
    "endless number": "<filter id='f'><feMorphology radius='1e999'/></filter><rect filter='url(#f)'/>",
    "dashes": f"<path stroke-dasharray='1' d='M0 0{'L900 0L0 10' * 1000}'/>" * 20,
    "dashes that are inherited": f"<path id='p' d='M0 0{'L900 0L0 10' * 1000}'/>"
    + "<g style='stroke-dasharray:.1'>"
    + "<use href='#p'/>" * 20
    + "</g>",
    "dashes of a class": "<style>.a{stroke-dasharray:1e-3 1e-3}</style>" + "<line class='a' x2='1000'/>" * 20,
    "dashes of a rule": "<style>line{stroke-dasharray:.001%}</style>" + "<line x2='1000'/>" * 20,
    "dashes of a length that is told": "<circle r='1' pathLength='1e6' stroke-dasharray='1'/>" * 20,
    "layers": "<g opacity='.5'><rect/><rect/></g>" * 3000,
}


@pytest.mark.parametrize("how", HEAVY)
def test_a_drawing_that_becomes_heavy_is_refused(how: str) -> None:
    with pytest.raises(RefusedError, match="draws more than 200000 shapes once all that it repeats is counted"):
        sanitised(svg_file(HEAVY[how]))


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ("<g>" * 200 + "</g>" * 200, "nested more than 100 deep"),
        ("<g id='a0'/>" + "".join(f"<g id='a{i}'><use href='#a{i - 1}'/></g>" for i in range(1, 200)), "nested more"),
        (f"<style>g{{--x:url(#p)}} rect{{fill:var(--x)}}</style><pattern id='p'/>{RECTS}", "variables"),
        ("<image href='data:image/png;base64,AAAA'/>", "damaged, or not of its type"),
        ("<image href='data:image/png;base64,AAA'/>", "damaged, or not of its type"),
        (f"<image href='data:image/png;base64,{b64encode(image_file(kind='JPEG')).decode()}'/>", "not of its type"),
    ],
)
def test_a_drawing_that_cannot_be_weighed_is_refused(inside: str, words: str) -> None:
    with pytest.raises(RefusedError, match=words):
        sanitised(svg_file(inside))


@pytest.mark.parametrize(
    "inside",
    [
        "<g id='a'><use href='#a'/></g>",
        "<g id='a'><use href='#b'/></g><g id='b'><use href='#a'/></g>",
        "<symbol id='chair'><path d='M0 0h1v1z'/><path d='M0 0h1v1z'/></symbol>" + "<use href='#chair'/>" * 5000,
        "<pattern id='hatch'><path d='M0 0h1'/></pattern>" + "<rect fill='url(#hatch)'/>" * 5000,
        "<linearGradient id='g'><stop/><stop/></linearGradient>" + "<g fill='url(#g)'>" * 9 + RECTS + "</g>" * 9,
        "<g stroke-dasharray='5,2'>" + f"<polyline points='{'10 20 500 300 ' * 10}'/>" * 1000 + "</g>",
        "<rect width='100%' height='100%' stroke-dasharray='4'/><path stroke-dasharray='none' d='M0 0h9'/>",
        "<style>.a{opacity:.4;fill:rgb(1,2,3)}</style>" + "<rect class='a'/>" * 20_000,
        "<clipPath id='c'><rect/></clipPath>" + "<g clip-path='url(#c)'><path d='M0 0h1'/></g>" * 20_000,
    ],
)
def test_a_usual_drawing_is_taken(inside: str) -> None:
    sanitised(svg_file(inside))


def test_animations_of_styles_are_removed() -> None:
    drawing, _, _ = sanitised(
        svg_file(
            "<style>rect{animation: x 1s /* ; */ infinite;fill:red}</style>"
            "<rect style='transition:all 9s;-webkit-animation:x 1s;fill:blue'/>"
        )
    )
    assert b"fill:red" in drawing
    assert b'style="fill:blue"' in drawing
    for gone in (b"animation", b"transition"):
        assert gone not in drawing


def test_an_embedded_image_counts_with_its_pixels() -> None:
    def drawing(width: int, times: int) -> bytes:
        data = b64encode(image_file(width, width, mode="1")).decode()
        return svg_file(f"<image id='i' href='data:image/png;base64,{data}'/>" + "<use href='#i'/>" * times)

    sanitised(drawing(2000, 20))
    with pytest.raises(RefusedError, match="draws more than"):
        sanitised(drawing(2000, 200))
    with pytest.raises(RefusedError, match="100 megapixels"):
        sanitised(drawing(10_000, 0))
