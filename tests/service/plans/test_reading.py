"""Uploaded files become images that browsers show, or are refused with a sentence."""

import math
from base64 import b64encode
from functools import partial
from io import BytesIO
from typing import Any

import pytest
from PIL import Image
from pymap3d.enu import geodetic2enu
from pyproj import Transformer
from resvg_py import svg_to_bytes

from dropanchor_schemas.site import Georeference
from dropanchor_service.plans.reading.file_types import file_type_of
from dropanchor_service.plans.reading.messages import ReadPlan, Request
from dropanchor_service.plans.reading.read_plan import read_plan
from dropanchor_service.plans.reading.refused import RefusedError
from support.plan_files import encrypted_pdf_file, geotiff_file, image_file, pdf_file, svg_file

XLINK = 'xmlns:x="http://www.w3.org/1999/xlink"'
BERLIN = Georeference(lat=52.5, lon=13.4, rotation_rad=0.3)


def read(content: bytes, **request: Any) -> ReadPlan:
    return read_plan(content, Request(media_type=file_type_of(content, ""), **request))


def problem(content: bytes, **request: Any) -> str:
    with pytest.raises(RefusedError) as refused:
        read(content, **request)
    return str(refused.value)


def opened(found: ReadPlan) -> Image.Image:
    image = Image.open(BytesIO(found.content))
    assert image.size == (found.description.width_px, found.description.height_px)
    assert found.description.media_type == f"image/{str(image.format).lower()}"
    return image


def test_an_image_keeps_its_pixels_and_loses_its_metadata() -> None:
    exif = Image.Exif()
    exif[0x010E] = "drawn by somebody"
    image = opened(read(image_file(exif=exif)))
    assert image.convert("RGB").getpixel((0, 0)) == (255, 0, 0)
    assert image.convert("RGB").getpixel((39, 19)) == (0, 0, 255)
    assert dict(image.getexif()) == {}


def test_a_photo_is_turned_as_its_metadata_says() -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # a quarter turn
    image = opened(read(image_file(kind="JPEG", exif=exif)))
    assert image.size == (20, 40)


def test_a_transparent_colour_stays_transparent() -> None:
    palette = Image.new("P", (4, 4))
    palette.putpalette([255, 0, 0, 0, 255, 0])
    file = BytesIO()
    palette.save(file, "PNG", transparency=0)
    assert opened(read(file.getvalue())).convert("RGBA").getpixel((0, 0))[3] == 0  # type: ignore[index]


@pytest.mark.parametrize(("kind", "mode"), [("JPEG", "CMYK"), ("TIFF", "RGB"), ("JPEG", "L")])
def test_other_colours_and_formats_become_those_of_browsers(kind: str, mode: str) -> None:
    assert opened(read(image_file(kind=kind, mode=mode))).mode in ("L", "RGB")


def test_a_page_of_a_pdf_is_drawn_at_200_dots_per_inch_or_fewer() -> None:
    pdf = pdf_file((72, 144), (3370, 2384))
    assert opened(read(pdf, page=1)).size == (200, 400)
    large = read(pdf, page=2).description
    assert large.width_px * large.height_px <= 16.1e6
    assert large.pages == 2
    assert problem(pdf, page=3) == "The PDF has 2 pages, and page 3 was asked for."


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (image_file(10_000, 10_000, mode="1"), "100 megapixels. At most 40"),
        (image_file(31_000, 1, mode="1"), "a side of 31000 pixels"),
        (image_file()[:70], "damaged"),
        (image_file(mode="I;16"), "8 bits per channel"),
        (encrypted_pdf_file(), "encrypted"),
        (pdf_file((100, 100))[:100], "damaged"),
        (b"MZ", "PNG, JPEG, SVG, PDF or GeoTIFF"),
        (b"", "PNG, JPEG, SVG, PDF or GeoTIFF"),
        (b"<html></html>", "no SVG"),
        (svg_file("<"), "damaged"),
        (svg_file(attributes='width="0" height="0"'), "cannot be drawn"),
        (
            svg_file("".join(f"<g id='a{i}'>" + f"<use href='#a{i - 1}'/>" * 10 + "</g>" for i in range(12))),
            "cannot be drawn",
        ),
        (svg_file('<image href="https://example.com/a.png"/>'), "refers to another file"),
        (svg_file('<image href="/etc/hostname"/>'), "refers to another file"),
        (svg_file('<image href="data:image/svg+xml;base64,AAAA"/>'), "refers to another file"),
        (svg_file('<use href="other.svg#a"/>'), "refers to another file"),
        (svg_file('<x:use x:href="other.svg#a"/>', f'{XLINK} viewBox="0 0 9 9"'), "refers to another file"),
        (svg_file('<rect fill="url(https://example.com/a)"/>'), "refers to another file"),
        (svg_file('<rect style="fill:URL( //example.com/a)"/>'), "refers to another file"),
        (svg_file("<style>@import 'https://example.com/a.css'</style>"), "refers to another file"),
        (b"<!DOCTYPE svg [<!ENTITY a '<image href=\"/a.png\"/>'>]>" + svg_file("&a;"), "refers to another file"),
        (b"<!DOCTYPE svg [<!ENTITY a SYSTEM 'file:///etc/hostname'>]>" + svg_file("<text>&a;</text>"), "damaged"),
    ],
)
def test_a_bad_file_is_refused_with_a_sentence(content: bytes, words: str) -> None:
    sentence = problem(content)
    assert words in sentence
    assert sentence.endswith(".")


def test_a_file_that_lies_about_its_type_is_refused() -> None:
    with pytest.raises(RefusedError, match="said to be image/png, but its content is application/pdf"):
        file_type_of(pdf_file((9, 9)), "image/png")
    with pytest.raises(RefusedError, match="said to be text/html"):
        file_type_of(image_file(), "text/html; charset=utf-8")
    assert file_type_of(image_file(), "application/octet-stream") == "image/png"
    assert file_type_of(image_file(kind="JPEG"), "image/jpg") == "image/jpeg"


def test_an_svg_becomes_what_it_draws_and_nothing_else_of_it_is_kept() -> None:
    image = b64encode(image_file()).decode()
    found = read(
        svg_file(
            '<metadata><i:x/></metadata><script>alert(1)</script><rect id="a" width="5" height="10" onclick="x()"/>'
            '<pattern id="p" width="1" height="1"><path d="M0 0h9v9z" fill="lime"/></pattern>'
            f'<use x:href="#a" x="15"/><image x="5" width="10" height="5" x:href="data:image/png;base64,{image}"/>',
            f'{XLINK} xmlns:i="http://ink" width="20mm" height="10mm" viewBox="0 0 20 10"',
        )
    )
    drawing = opened(found).convert("RGBA")
    assert drawing.size == (4096, 2048)
    colours = [drawing.getpixel((column, 500)) for column in (500, 1500, 2500, 3500)]
    assert colours == [(0, 0, 0, 255), (255, 0, 0, 255), (0, 0, 255, 255), (0, 0, 0, 255)]
    assert drawing.getpixel((2048, 1900)) == (0, 0, 0, 0)
    assert b"alert" not in found.content


def test_a_plan_whose_texts_are_lost_for_want_of_a_font_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    drawing = svg_file('<text y="20">Gate</text>')
    assert read(drawing).description.note == ""
    monkeypatch.setattr(
        "dropanchor_service.plans.reading.svg.svg_to_bytes", partial(svg_to_bytes, skip_system_fonts=True)
    )
    assert "install one, such as Debian's package fonts-dejavu-core" in read(drawing).description.note
    assert read(svg_file()).description.note == ""


def corner_in_site(easting: float, northing: float) -> complex:
    """Return where a point of EPSG:25833 lies in the site, by the libraries alone."""
    lon, lat = Transformer.from_crs(25833, 4326, always_xy=True).transform(easting, northing)
    east, north, _ = geodetic2enu(lat, lon, 0.0, BERLIN.lat, BERLIN.lon, 0.0)
    return complex(east, north) * complex(math.cos(BERLIN.rotation_rad), -math.sin(BERLIN.rotation_rad))


@pytest.mark.parametrize("is_point", [False, True])
def test_a_geotiff_lies_where_its_coordinates_say(is_point: bool) -> None:
    half = 0.05 if is_point else 0.0
    content = geotiff_file(400, 200, (391_400.0 + half, 5_818_000.0 - half), 0.1, is_point=is_point)
    placement = read(content, georeference=BERLIN).description.placement
    assert placement is not None
    turn = complex(math.cos(placement.rotation_rad), math.sin(placement.rotation_rad)) * placement.m_per_px
    for pixel, place in ((-200 + 100j, (391_400.0, 5_818_000.0)), (200 - 100j, (391_440.0, 5_817_980.0))):
        assert abs(complex(placement.x, placement.y) + turn * pixel - corner_in_site(*place)) < 0.01


def test_a_world_file_places_the_centre_of_the_first_pixel() -> None:
    world = [0.1, 0.0, 0.0, -0.1, 5.05, 7.95]  # its left upper corner lies at (5, 8)
    placement = read(image_file(40, 20), world=world, crs="site").description.placement
    assert placement is not None
    assert (placement.x, placement.y) == pytest.approx((7.0, 7.0))
    assert (placement.rotation_rad, placement.m_per_px) == pytest.approx((0.0, 0.1))


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"world": [0.1, 0, 0, -0.2, 0, 0], "crs": "site"}, "not square"),
        ({"world": [0.1, 0, 0, 0.1, 0, 0], "crs": "site"}, "mirrored"),
        ({"world": [0, 0, 0, 0, 0, 0], "crs": "site"}, "not square"),
        ({"world": [0.1, 0, 0, -0.1, 9e9, 0], "crs": "site"}, "100 km"),
        ({"world": [0.1, 0, 0, -0.1, 0, 0]}, "EPSG:25832"),
        ({"world": [0.1, 0, 0, -0.1, 0, 0], "crs": "EPSG:25833"}, "no georeference"),
        ({"world": [0.1, 0, 0, -0.1, 0, 0], "crs": "EPSG:999999", "georeference": BERLIN}, "EPSG:999999"),
        ({"world": [0.1, 0, 0, -0.1, 9e6, 9e9], "crs": "EPSG:25833", "georeference": BERLIN}, "100 km"),
    ],
)
def test_an_image_that_cannot_place_itself_says_why(request_: dict[str, Any], words: str) -> None:
    description = read(image_file(), **request_).description
    assert description.placement is None
    assert words in description.note


def test_a_geotiff_without_a_known_coordinate_system_takes_the_one_that_is_given() -> None:
    content = geotiff_file(40, 20, (391_400.0, 5_818_000.0), 0.1, epsg=None)
    assert "names no coordinate system" in read(content, georeference=BERLIN).description.note
    assert read(content, georeference=BERLIN, crs="EPSG:25833").description.placement is not None
