"""The attribution of a file is HTML of others: text and web links remain."""

import pytest

from dropanchor_service.basemap.attribution import MAX_PARTS, MAX_TEXT, credits_in


@pytest.mark.parametrize(
    ("html", "parts"),
    [
        ("", []),
        (" \n ", []),
        ("© Land survey", [("© Land survey", None)]),
        ('<a href="https://a.example/b" target="_blank">&copy; A</a>', [("© A", "https://a.example/b")]),
        ('<a href="http://a.example">A</a>, <b>B</b>', [("A", "http://a.example"), (", ", None), ("B", None)]),
        ("A\n\n <b>B</b>", [("A ", None), ("B", None)]),
        ('<a href="javascript:alert(1)">A</a>', [("A", None)]),
        ("<script>alert(1)</script><style>p{}</style>A", [("A", None)]),
        ('<img src=x onerror="alert(1)">A &lt;b&gt;', [("A <b>", None)]),
        (f'<a href="https://{"a" * 600}">A</a>', [("A", None)]),
    ],
)  # fmt: skip
def test_text_and_web_links_remain(html: str, parts: list[tuple[str, str | None]]) -> None:
    assert [(part.text, part.link) for part in credits_in(html)] == parts


def test_a_long_attribution_is_cut() -> None:
    assert len(credits_in("<b>A</b>" * 1000)) == MAX_PARTS
    assert len(credits_in("A" * 1000)[0].text) == MAX_TEXT
