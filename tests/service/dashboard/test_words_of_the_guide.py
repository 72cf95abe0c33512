"""What the guides call a button is what the page calls it."""

import re
from pathlib import Path

from dropanchor_service.api.app import DASHBOARD

GUIDES = DASHBOARD.parents[1] / "docs" / "how-to"


def test_the_buttons_for_something_new_have_the_names_that_the_guides_use() -> None:
    named = {name for guide in GUIDES.glob("*.md") for name in re.findall(r"\*(New[ :][^*]+)\*", _text(guide))}
    texts = " ".join(map(_text, (DASHBOARD / "i18n" / "en").glob("*.js")))
    shown = set(re.findall(r"\": \"(New[ :][^\"]+)\"", texts))
    shown |= {f"New: {kind}" for kind in re.findall(r"\"kind\.[^\"]+\": \"([^\"]+)\"", texts)}
    assert named >= {"New webhook", "New: Tags too close"}
    assert named <= shown


def _text(path: Path) -> str:
    return " ".join(path.read_text(encoding="utf-8").split())
