"""A kind of event stands in the files that the guide names, and has its words in every language."""

import re
from pathlib import Path
from typing import get_args

import pytest

import dropanchor_schemas
from dropanchor_schemas.destinations import Language
from dropanchor_schemas.events import RetractionReason
from dropanchor_schemas.zones import EventType, TagRule, TooCloseRule
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.delivery.words import words_in
from support.sentences import placeholders

SERVICE = DASHBOARD.parent
SCHEMAS = Path(dropanchor_schemas.__file__).parent
GUIDE = SERVICE.parent / "docs" / "how-to" / "change-the-code.md"
OTHERS = {"type", "id", "name", "tags", "groups", "severity", "muted_until_ns"}


def named_by_the_guide() -> set[Path]:
    section = GUIDE.read_text("utf-8").partition("## Add a kind of event\n")[2].partition("\n## ")[0]
    paths = re.findall(r"^\d\. `([^`]+)`", section, re.MULTILINE)
    return {SCHEMAS.parents[1] / path if path.startswith("schemas/") else SERVICE / path for path in paths}


@pytest.mark.parametrize("rule", ["lost", "ambiguous"])
def test_a_kind_of_event_stands_in_the_four_files_that_the_guide_names(rule: str) -> None:
    words = re.compile(rf"dropanchor\.tag\.{rule}\b|TAG_{rule.upper()}\b|{rule.title()}Rule|rule\.{rule}|_{rule}\"")
    files = [
        file for folder in (SCHEMAS, SERVICE) for file in folder.rglob("*") if file.suffix in (".py", ".js", ".html")
    ]
    assert {file for file in files if words.search(file.read_text("utf-8"))} == named_by_the_guide()
    assert len(named_by_the_guide()) == 4


@pytest.mark.parametrize("language", Language)
def test_every_language_has_the_same_words_for_every_event_reason_and_value(language: Language) -> None:
    english, texts = words_in(Language.ENGLISH).texts, words_in(language).texts
    rules = [TooCloseRule, *get_args(TagRule)]
    values = {f"rule.field.{name}" for rule in rules for name in rule.model_fields.keys() - OTHERS}
    kinds = {f"{word}.{event}" for word in ("event", "kind") for event in EventType}
    of_events = {key for key in texts if not key.startswith("mail.")}
    assert of_events == kinds | values | {f"event.why.{reason}" for reason in RetractionReason}
    assert {key: placeholders(text) for key, text in texts.items()} == {k: placeholders(v) for k, v in english.items()}
    assert {rule.model_fields["type"].annotation.__args__[0] for rule in rules} <= {
        event.rpartition(".")[2] for event in EventType
    }
