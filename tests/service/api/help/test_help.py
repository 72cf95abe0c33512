"""The service serves its documentation: every page, with links that lead somewhere, searched, and without a script."""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urldefrag, urljoin

import pytest
from fastapi import FastAPI

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.api.help.documents import FOLDER, documents, without_links_outside
from dropanchor_service.api.help.rendering import page
from dropanchor_service.api.starting import create_starting_app
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator
from support.api import ask, make_api_bench

BASE = "http://service/help/"


class Links(HTMLParser):
    """The links of a page, and the names in it that links may lead to."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.names: set[str] = set()
        self.tags: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        values = dict(attrs)
        self.names.add(values.get("id") or "")
        if tag == "a":
            self.targets.append(values.get("href") or "")


@pytest.fixture(scope="module")
def app() -> FastAPI:
    return make_api_bench().app(DASHBOARD)


@pytest.mark.parametrize("path", documents())
def test_every_link_of_a_served_page_leads_to_a_page_and_to_a_heading_of_it(path: str) -> None:
    links = Links(page(path))
    assert "script" not in links.tags
    for target in links.targets:
        url, heading = urldefrag(urljoin(BASE + path, target))
        if not url.startswith("http://service/"):
            assert url.startswith("http"), target
            continue
        assert url.startswith(BASE), target
        assert not heading or heading in Links(page(url.removeprefix(BASE) or "README.md")).names, target


def test_every_file_of_the_documentation_is_a_page(app: FastAPI) -> None:
    files = {file.relative_to(FOLDER).as_posix() for file in FOLDER.rglob("*.md")}
    assert {"tutorial.md", "how-to/use-the-page.md", "decisions/README.md"} <= files == documents().keys()
    answer = ask(app, "GET", "/help/how-to/use-the-page.md")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert '<h2 id="several-tags">Several tags</h2>' in answer.text
    assert ask(app, "GET", "/help/").text == page("README.md")
    assert ask(app, "GET", "/help").headers["location"] == "help/"


def test_the_policy_of_a_page_allows_no_script(app: FastAPI) -> None:
    policy = ask(app, "GET", "/help/tutorial.md").headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; style-src 'self'; ")
    assert "script" not in policy


@pytest.mark.parametrize(
    "path", ["gone.md", "how-to", "../README.md", "%2e%2e/README.md", "how-to/../../pyproject.toml"]
)
def test_nothing_but_pages_is_served(app: FastAPI, path: str) -> None:
    assert ask(app, "GET", f"/help/{path}").status_code in (307, 404)


def test_a_service_that_starts_serves_its_documentation_already() -> None:
    assert ask(create_starting_app(lambda: "compiling"), "GET", "/help/tutorial.md").status_code == 200


def test_the_documentation_needs_no_credentials(tmp_path: Path) -> None:
    app = make_api_bench().app(DASHBOARD, authenticator=Authenticator({SOURCE: ApiKeys(tmp_path)}))
    assert ask(app, "GET", "/api/v1/poses").status_code == 401
    assert ask(app, "GET", "/help/tutorial.md").status_code == 200


def test_a_search_lists_the_page_about_it_first(app: FastAPI) -> None:
    found = re.findall(r'<li><a href="([^"]+)">[^<]*</a><p>', ask(app, "GET", "/help/?q=Floor%20plan").text)
    assert found[0] == "how-to/show-a-floor-plan.md"
    assert 1 < len(found) <= 20
    assert "<h1>0 pages with" in ask(app, "GET", "/help/?q=xyzzy").text


def test_what_is_searched_is_shown_as_text(app: FastAPI) -> None:
    text = ask(app, "GET", '/help/?q="><script>alert(1)</script>').text
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in text


def test_links_out_of_the_documentation_become_text() -> None:
    text = "[a](b.md) [c](../../x.md#y) [d](https://example.org) [e](#f) [g](../how-to/b.md)"
    expected = "[a](b.md) c [d](https://example.org) [e](#f) [g](../how-to/b.md)"
    assert without_links_outside("how-to/a.md", text, {"how-to/b.md"}) == expected
