"""The samples of the tutorial and the guides are right as they stand: commands, requests, settings and programs.

`tests/e2e/test_guides.py` runs those that can run, and lists the others.
"""

import argparse
import ast
import json
import subprocess
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

from dropanchor_service import cli
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client import cli as tag_cli
from support.patience import PATIENCE_S
from support.samples import Sample, called, samples
from support.service import ROOT

SHELL = samples("sh")
DOCUMENT = json.loads((ROOT / "schemas" / "dropanchor_schemas" / "openapi.json").read_text())
OURS = ("dropanchor_schemas", "dropanchor_schemas.epochs", "dropanchor_tag_client")
WITH = {
    "run-a-cluster.md: checkpoint_s = 10": 'url = "postgresql://db.example/yard"\nbucket = "yard"\n',
    "serve-several-sites.md: [sites.south]": '[security.oidc]\nissuer = "https://id.example"\naudience = "yard"\n',
}
"""Settings that a page tells its reader to have already."""
CURL = argparse.ArgumentParser("curl", allow_abbrev=False)
for flag in "sNLOJ":
    CURL.add_argument(f"-{flag}", action="store_true")
CURL.add_argument("-X", dest="method")
CURL.add_argument("-d", dest="body")
CURL.add_argument("-H", "-o", "--cacert", action="append")
CURL.add_argument("url")


def named(all_of_them: list[Sample]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("sample", all_of_them, ids=lambda sample: sample.name)


@named(SHELL)
def test_a_script_is_one_of_the_shell(sample: Sample) -> None:
    subprocess.run(["bash", "-n"], input=sample.text, text=True, check=True, timeout=PATIENCE_S)


@named([sample for sample in SHELL if called(sample.text, "dropanchor")])
def test_the_service_knows_each_command_with_its_options(sample: Sample) -> None:
    for words in called(sample.text, "dropanchor"):
        cli._parser(words[:1], words).parse_args(words)


@named([sample for sample in SHELL if called(sample.text, "dropanchor-tag")])
def test_the_tag_client_knows_each_command_with_its_options(sample: Sample) -> None:
    for words in called(sample.text, "dropanchor-tag"):
        tag_cli.parser(*words[:1]).parse_args(words)


def test_a_command_that_does_not_exist_is_noticed(capsys: pytest.CaptureFixture[str]) -> None:
    wrong = Sample("a.md", "sh", "echo 1 | dropanchor-tag publish \\\n  --tga x  # a comment\n")
    with pytest.raises(SystemExit):
        test_the_tag_client_knows_each_command_with_its_options(wrong)
    assert "--tga" in capsys.readouterr().err


@named([sample for sample in SHELL if called(sample.text, "curl")])
def test_every_request_is_one_of_the_interface(sample: Sample) -> None:
    for words in called(sample.text, "curl"):
        asked = CURL.parse_args(words)
        url = urlsplit(asked.url)
        if "/api/v1/" in url.path and not url.path.endswith("/openapi.json"):
            method = asked.method or ("post" if asked.body else "get")
            operation = operation_of(method.lower(), url.path.partition("/api/v1/")[2])
            known = {one["name"] for one in operation.get("parameters", []) if one["in"] == "query"}
            assert parse_qs(url.query).keys() <= known, url.query


def operation_of(method: str, path: str) -> dict[str, Any]:
    """Return the operation that a request asks for, as the OpenAPI document has it."""
    parts = path.split("/")
    for template, operations in DOCUMENT["paths"].items():
        names = template.removeprefix("/api/v1/").split("/")
        if len(names) == len(parts) and all(n in (p, f"{{{n[1:-1]}}}") for n, p in zip(names, parts, strict=True)):
            found: dict[str, Any] = operations[method]
            return found
    raise AssertionError(f"{method} {path} is no operation")


@named(samples("toml"))
def test_settings_are_understood(sample: Sample, tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text(sample.text + WITH.get(sample.name, ""))
    load_settings(file, environment={})


@named(samples("json"))
def test_json_is_json(sample: Sample) -> None:
    json.loads(sample.text)


@named(samples("python"))
def test_a_program_compiles_and_what_it_imports_of_ours_exists(sample: Sample) -> None:
    for node in ast.walk(ast.parse(sample.text)):
        if isinstance(node, ast.ImportFrom) and node.module in OURS:
            module = import_module(node.module)
            assert all(hasattr(module, alias.name) for alias in node.names)
