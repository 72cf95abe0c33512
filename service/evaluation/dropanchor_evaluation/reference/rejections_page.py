"""The page of rejections: every reason for which a message or a sample is not used."""

from dropanchor_evaluation.reference.markdown import table
from dropanchor_schemas.rejections import REASONS_EXPLAINED

_INTRODUCTION = """\
# Rejections

Decoding never fails: bytes become samples or a named rejection. The service counts every rejection under one of these
names, in `dropanchor_rejected_total` and per tag in `GET /api/v1/tags/{tag}`. A *message* is refused as a whole, a
*sample* alone; the good samples of its message are used.
"""


def page() -> str:
    """Return the page as Markdown."""
    rows = ((f"`{reason}`", *explained) for reason, explained in REASONS_EXPLAINED.items())
    return f"{_INTRODUCTION}\n{table(('reason', 'of what', 'why'), rows)}"
