"""A program of the pages comes as one file, in the order in which a browser would run its modules."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.api.routes.page_bundle import PROGRAMS, BundleError, bundle
from support.api import ask, make_api_bench
from support.patience import PATIENCE_S


def write(folder: Path, **modules: str) -> None:
    (folder / "far").mkdir(exist_ok=True)
    for name, source in modules.items():
        (folder / f"{name.replace('__', '/')}.js").write_text(source)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.parametrize("is_bundled", [True, False])
def test_a_bundle_does_what_its_modules_do(tmp_path: Path, is_bundled: bool) -> None:
    write(
        tmp_path,
        main='import { a, twice as double, Thing } from "./far/lib.js";\nimport log from "./log.js";\n'
        'import { late } from "./waits.js";\n/** @type {import("./log.js").Kind} a comment */\n'
        'log.push("main", a, double(4), new Thing().name(), late);\n'
        'import("./far/later.js").then(({ place }) => { log.push(place()); console.log(JSON.stringify(log)); });\n',
        far__lib='import log from "../log.js";\nlog.push("lib");\nexport const a = 1;\nconst hidden = 2;\n'
        "export function twice(n) {\n  return hidden * n;\n}\nexport class Thing {\n  name = () => typeof log;\n}\n"
        "function* numbers() {}\nexport { numbers };\n",
        far__later='export const place = () => new URL("x", import.meta.url).href.split("/").slice(-2).join("/");\n',
        waits="export const late = await new Promise((done) => setTimeout(() => done(7), 1));\n",
        log="export default [];\n",
    )
    if is_bundled:
        (tmp_path / "main.js").write_text(bundle(tmp_path, "main.js"))
    (tmp_path / "package.json").write_text('{"type": "module"}')
    done = subprocess.run(["node", "main.js"], cwd=tmp_path, check=True, capture_output=True, timeout=PATIENCE_S)
    assert json.loads(done.stdout) == ["lib", "main", 1, 8, "object", 7, "far/x"]


@pytest.mark.parametrize(
    ("modules", "words"),
    [
        ({"main": 'import { a } from "./b.js";\n', "b": 'import { c } from "./main.js";\n'}, "in a circle"),
        ({"main": 'export * from "./b.js";\n', "b": ""}, "main.js: this form of import or export"),
        ({"main": "export let n = 1;\n"}, "export let n = 1;"),
    ],
)
def test_what_would_change_the_meaning_is_refused(tmp_path: Path, modules: dict[str, str], words: str) -> None:
    write(tmp_path, **modules)
    with pytest.raises(BundleError, match=re.escape(words)):
        bundle(tmp_path, "main.js")


def test_every_program_comes_without_imports_and_its_modules_can_still_be_fetched() -> None:
    app = make_api_bench().app(DASHBOARD)
    for program in PROGRAMS:
        response = ask(app, "GET", f"/{program}")
        assert response.headers["content-type"].startswith("text/javascript")
        assert not re.search(r"^import ", response.text, re.MULTILINE), program
        again = ask(app, "GET", f"/{program}", headers={"if-none-match": response.headers["etag"]})
        assert again.status_code == 304
    assert "\nexport class Fleet" in ask(app, "GET", "/data/fleet.js").text


def test_the_page_comes_in_a_third_of_its_bytes() -> None:
    app = make_api_bench().app(DASHBOARD)
    for path in ("/page/main.js", "/docs/swagger-ui/swagger-ui-bundle.js"):
        response = ask(app, "GET", path, headers={"accept-encoding": "gzip"})
        assert response.headers["content-encoding"] == "gzip"
        assert 3 * int(response.headers["content-length"]) < len(response.content), path
        assert "content-encoding" not in ask(app, "GET", path, headers={"accept-encoding": "identity"}).headers


def test_every_program_that_a_page_or_a_worker_names_is_bundled() -> None:
    scripts = {
        f"{page.parent.relative_to(DASHBOARD)}/{name}".removeprefix("./")
        for page in DASHBOARD.rglob("index.html")
        for name in re.findall(r'type="module" src="([^"]+)"', page.read_text())
    }
    workers = {
        str((source.parent / name).relative_to(DASHBOARD))
        for source in DASHBOARD.rglob("*.js")
        for name in re.findall(r'new Worker\(new URL\("([^"]+)"', source.read_text())
    }
    catalogues = {str(path.relative_to(DASHBOARD)) for path in DASHBOARD.glob("i18n/*/messages.js")}
    assert (scripts | workers | catalogues) - {"docs/docs.js"} == PROGRAMS


def test_a_changed_module_is_in_the_next_answer(tmp_path: Path) -> None:
    (tmp_path / "page").mkdir()
    (tmp_path / "index.html").write_text("<!doctype html>")
    (tmp_path / "page" / "main.js").write_text('import { a } from "./a.js";\nconsole.log(a);\n')
    app = make_api_bench().app(tmp_path)
    for text in ("first", "second"):
        (tmp_path / "page" / "a.js").write_text(f'export const a = "{text}";\n')
        assert text in ask(app, "GET", "/page/main.js").text
