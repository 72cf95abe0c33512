"""The words of mails in English and German: those of the page."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, tzinfo
from functools import cache
from importlib.resources import files

from dropanchor_schemas.destinations import Language

_MARKS_AND_TIMES = {
    Language.ENGLISH: (",.", "%Y-%m-%d %H:%M:%S %Z"),
    Language.GERMAN: (".,", "%d.%m.%Y %H:%M:%S %Z"),
}


@dataclass(frozen=True)
class Words:
    """How a mail says things. texts: as in `dashboard/i18n/en/events.js`. zone: of its times; None: of the host."""

    texts: Mapping[str, str]
    marks: str
    times: str
    zone: tzinfo | None = None

    def number(self, value: float, decimals: int) -> str:
        return f"{value:,.{decimals}f}".translate(str.maketrans(",.", self.marks))

    def time(self, t_ns: int) -> str:
        return datetime.fromtimestamp(t_ns / 1e9, UTC).astimezone(self.zone).strftime(self.times)


@cache
def words_in(language: Language) -> Words:
    """Return the words of a language. In the module of the page, they are JSON."""
    module = files("dropanchor_service").joinpath(f"dashboard/i18n/{language}/events.js").read_text("utf-8")
    return Words(json.loads(module.partition("export default ")[2].rstrip(";\n")), *_MARKS_AND_TIMES[language])
