"""The folder of the pictures: its page says what they show, and from which sources of the page they were made."""

from pathlib import Path

from dropanchor_evaluation.results import ROOT, Measured, older, problems, write

PAGE = ROOT / "service" / "docs" / "pictures" / "README.md"
SOURCES = ["service/dropanchor_service/dashboard"]
_SHOWN = {
    "live": "six tags around one anchor; one of them may be at either of two places, and the page says why",
    "past": "the past of the same tags: who was where for how long",
}


def record(page: Path) -> None:
    """Write the table of the pictures beside the page into it, with the digest of the sources. Raises OSError."""
    rows = [f"| [{file.name}]({file.name}) | {_SHOWN[file.stem.split('-')[0]]} |" for file in pictures(page)]
    write(ROOT, page, "pictures", "| picture | shows |\n|---|---|\n" + "\n".join(rows), Measured(SOURCES))


def pictures(page: Path) -> list[Path]:
    """Return the pictures beside the page, by name."""
    return sorted(page.parent.glob("*.webp"))


def is_outdated(page: Path) -> bool:
    """Return whether the page of Dropanchor has changed since its pictures were made. Raises OSError."""
    return any(problems(ROOT, [page])) or bool(older(ROOT, page))
