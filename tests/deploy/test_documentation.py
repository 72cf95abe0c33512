"""The documentation of a release: in the wheel of the service, and as a site of static files."""

import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from zipfile import ZipFile

import pytest
from playwright.sync_api import expect

from dropanchor_service.api.help.documents import FOLDER, documents
from support.browser import PausedBrowser, open_page
from support.patience import PATIENCE_S
from support.service import ROOT, environment


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing about requests."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the site, built as `make docs` does it, where a warning ends the build."""
    folder = tmp_path_factory.mktemp("site")
    options = ["--config-file", "service/mkdocs.yml", "--site-dir", str(folder)]
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", *options],
        cwd=ROOT,
        env=environment(NO_MKDOCS_2_WARNING="1"),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert (built.returncode, built.stderr) == (0, "")
    return folder


@pytest.fixture
def address(site: Path) -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


def test_the_site_has_every_page(site: Path) -> None:
    pages = {path.replace("README.md", "index.html").replace(".md", ".html") for path in documents()}
    assert pages <= {file.relative_to(site).as_posix() for file in site.rglob("*.html")}


@pytest.mark.browser
def test_the_site_is_searched_without_another_server(address: str, shared_chromium: PausedBrowser) -> None:
    with shared_chromium.driven() as browser, open_page(browser, f"{address}/tutorial.html") as page:
        expect(page.page.locator(".md-nav--primary")).to_contain_text("How-to guides")
        page.page.get_by_role("textbox", name="Search").press_sequentially("floor plan")  # it listens to keys
        found = page.page.locator(".md-search-result__link", has_text="Show a floor plan").first
        found.click()
        expect(page.page.locator("h1")).to_contain_text("Show a floor plan")
        assert page.origins == {address}
        assert page.errors == []


def test_the_wheel_of_the_service_has_the_pages_where_it_looks_for_them(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT / "service", check=True, capture_output=True, timeout=PATIENCE_S)
    (wheel,) = tmp_path.glob("*.whl")
    with ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "installed")
    script = "from dropanchor_service.api.help import documents as d; print(d.FOLDER, len(d.documents()))"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=environment(PYTHONPATH=f"{tmp_path / 'installed'}:{ROOT / 'schemas'}:{ROOT / 'tag_client'}"),
        check=True,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.stdout.split() == [str(tmp_path / "installed" / "dropanchor_service" / "docs"), str(len(documents()))]
    assert FOLDER == ROOT / "service" / "docs"
