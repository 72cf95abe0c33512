"""All that the service can say to a page: the calls of `say` in the code, and what comes from elsewhere."""

import ast
import json
import shutil
import string
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import dropanchor_schemas
import dropanchor_service
from dropanchor_schemas.sentences import phrase_of
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.plausibility.verdicts import SENTENCES
from support.patience import PATIENCE_S

PACKAGES = tuple(Path(str(package.__file__)).parent for package in (dropanchor_schemas, dropanchor_service))
PREFIX = "say."

CATALOGUE = """
globalThis.location = { search: "", hash: "" };
const { default: messages } = await import(`${process.argv[1]}/i18n/${process.argv[2]}/messages.js`);
console.log(JSON.stringify(messages));
"""
IN_THE_PAGE = """
import { readFileSync } from "node:fs";
globalThis.location = { search: `?lang=${process.argv[2]}`, hash: "" };
const { endOf, refusal, said } = await import(process.argv[1] + "/i18n/said.js");
const { words } = await import(process.argv[1] + "/data/format.js");
const { sentences = [], codes = [], refusals = [], ends = [] } = JSON.parse(readFileSync(0));
const inWords = [
  ...sentences.map(({ text, phrase }) => said(text, phrase)),
  ...codes.map(words),
  ...refusals.map((problem) => refusal(Object.assign(new Error(problem.detail), { problem }))),
  ...ends.map(endOf),
];
console.log(JSON.stringify(inWords));
"""


class Said(NamedTuple):
    """A call of `say`. text: None where it is not written in the call."""

    code: str | None
    text: str | None
    values: frozenset[str]
    where: str


@cache
def calls() -> tuple[Said, ...]:
    """Return every call of `say` in the code."""
    return tuple(_calls())


def _calls() -> Iterator[Said]:
    for file in (file for package in PACKAGES for file in sorted(package.rglob("*.py"))):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "say":
                code, text = (_written(argument) for argument in call.args)
                names = frozenset(str(value.arg) for value in call.keywords)
                yield Said(code, text, names, f"{file.name}:{call.lineno}")


def about_sensors() -> Iterator[Said]:
    """Yield what the check of the sensors can say."""
    for name, text in SENTENCES.items():
        yield Said(f"sensor.{name}", text, placeholders(text), "verdicts.py")


def placeholders(message: str | dict[str, str]) -> frozenset[str]:
    """Return the names of the values in a message of the page, or in a text of the service."""
    texts = [message] if isinstance(message, str) else list(message.values())
    return frozenset(name for text in texts for _, name, _, _ in string.Formatter().parse(text) if name)


def messages(language: str) -> dict[str, Any]:
    """Return all messages of the page in a language."""
    found: dict[str, Any] = _run(CATALOGUE, language, "")
    return found


def in_words(language: str, sentences: list[str] | None = None, **texts: Any) -> list[str]:
    """Return what the page makes of sentences, and of `codes`, `refusals` (problems) and `ends` of WebSockets."""
    coded = [{"text": text, "phrase": phrase_of(text)} for text in sentences or []]
    found: list[str] = _run(IN_THE_PAGE, language, json.dumps({"sentences": coded} | texts))
    return found


def _written(node: ast.expr) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _run(program: str, language: str, text: str) -> Any:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: this test runs a module of the page")
    command = [node, "--input-type=module", "--eval", program, str(DASHBOARD), language]
    run = subprocess.run(command, input=text, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    return json.loads(run.stdout)
