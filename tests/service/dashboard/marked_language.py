"""A language whose every message is marked, to find the texts of a page that are not from its catalogue."""

import json
import re
import shutil
import subprocess
from typing import Any

import pytest
from playwright.sync_api import Page, Route

from dropanchor_service.api.app import DASHBOARD

EXAMPLES = ("EPSG:25832", "https://", "URL", "shift@example.com")
"""In the fields of forms, the same in every language."""
LOAD = "const { default: all } = await import(process.argv[1]); console.log(JSON.stringify(all));"
RECORD = """
const write = CanvasRenderingContext2D.prototype.fillText;
window.written = new Set();
CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
    window.written.add(text);
    return write.call(this, text, ...place);
};
"""
TEXTS = """() => {
    const texts = [document.title];
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
        const { data, parentElement } = walker.currentNode;
        if (!parentElement.closest("code, kbd, script, time, [lang]:not(html)")) texts.push(data);
    }
    for (const name of ["aria-label", "title", "placeholder", "alt"]) {
        for (const element of document.querySelectorAll(`[${name}]:not(time)`)) texts.push(element.getAttribute(name));
    }
    return [...texts, ...window.written];
}"""
SYMBOLS = re.compile(
    r"(?<![A-Za-z])(m/s2?|rad/s|deg/s|cm|mm|km|mg|g|mi|mph|ft|m|s|min|h|d|MB|ms|dBm|°C|V|σ|CSV|JSON|GeoJSON|GPX|UTC|KML|Parquet|USB|Bluetooth)(?![A-Za-z])"
)


def marked(message: str) -> str:
    """Return a message whose every word is inside marks, and whose values are not."""
    text = r"\{\w+\}|[^\s{}]*[^\W\d_][^{}]*?(?=\s*(?:[{}]|$))"
    return re.sub(text, lambda found: found[0] if found[0].startswith("{") else f"⟦{found[0]}⟧", message)


def speak_marked(page: Page) -> None:
    """Make German the marked language, and record what is written on the map."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: this test reads the messages of the page with it")
    command = [node, "--input-type=module", "--eval", LOAD, str(DASHBOARD / "i18n/de/messages.js")]
    catalogue: dict[str, Any] = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    for key, message in catalogue.items():
        catalogue[key] = marked(message) if isinstance(message, str) else {n: marked(m) for n, m in message.items()}
    catalogue["compass.points"] = " ".join(f"⟦{point}⟧" for point in range(16))
    body = f"export default {json.dumps(catalogue)};"

    def answer(route: Route) -> None:
        route.fulfill(body=body, content_type="text/javascript")

    page.route("**/i18n/de/messages.js", answer)
    page.add_init_script(RECORD)


def unmarked(page: Page, *data: str) -> set[str]:
    """Return the texts of the page with words that are neither from the catalogue, nor symbols, nor these data."""
    found = set()
    for text in page.evaluate(TEXTS):
        rest = re.sub(r"⟦[^⟦⟧]*⟧", " ", text)
        for known in sorted(("Dropanchor", *EXAMPLES, *data), key=len, reverse=True):
            rest = rest.replace(known, " ")
        if re.search(r"[^\W\d_]", SYMBOLS.sub(" ", rest)):
            found.add(text)
    return found
