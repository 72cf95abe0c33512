"""The AsyncAPI document is valid by AsyncAPI's own schema and matches the keys and models of the contract."""

import json
import shutil
import subprocess
import tarfile
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator, Draft202012Validator

from dropanchor_schemas import asyncapi, keys
from dropanchor_schemas.samples import SamplesMessage
from support.patience import PATIENCE_S

SPECS = "@asyncapi/specs@6.10.0"


@pytest.fixture(scope="module")
def specification(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Fetch AsyncAPI's own JSON Schema of a 3.0 document from npm."""
    folder = tmp_path_factory.mktemp("specs")
    if shutil.which("npm") is None:
        pytest.skip("npm is not installed: AsyncAPI's own schema cannot be fetched")
    fetched = subprocess.run(
        ["npm", "pack", "--silent", SPECS], cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S
    )
    if fetched.returncode:
        pytest.skip(f"npm cannot fetch {SPECS}: {fetched.stderr.strip()[-200:]}")
    with tarfile.open(next(folder.glob("*.tgz"))) as archive:
        file = archive.extractfile("package/schemas/3.0.0.json")
        assert file is not None
        schema: dict[str, Any] = json.load(file)
    return schema


def test_the_document_is_valid_asyncapi(specification: dict[str, Any]) -> None:
    errors = [error.message for error in Draft7Validator(specification).iter_errors(asyncapi.document())]
    assert errors == []


def test_a_broken_document_is_invalid(specification: dict[str, Any]) -> None:
    document = asyncapi.document()
    document["operations"]["receiveSamples"]["action"] = "listen"
    assert not Draft7Validator(specification).is_valid(document)


def test_every_reference_resolves() -> None:
    document = asyncapi.document()
    for reference in _references(document):
        target: Any = document
        for part in reference.removeprefix("#/").split("/"):
            target = target[part]


def test_the_addresses_are_the_keys_of_the_contract() -> None:
    channels = asyncapi.document()["channels"]
    assert channels["samples"]["address"].format(site="yard", tag="forklift-7") == keys.samples_key(
        "yard", "forklift-7"
    )
    assert channels["anchor"]["address"].format(site="yard", anchor="7") == keys.anchor_key("yard", "7")
    assert channels["ownerAlive"]["address"].format(bucket="yard", epoch=7) == keys.owner_key("yard", 7)
    assert {name for channel in channels.values() for name in channel["parameters"]} == {
        "site",
        "tag",
        "anchor",
        "service",
        "bucket",
        "epoch",
    }


def test_the_examples_validate_against_the_schemas() -> None:
    document = asyncapi.document()
    schema = {"$ref": "#/components/schemas/SamplesMessage", "components": document["components"]}
    for example in SamplesMessage.model_json_schema()["examples"]:
        Draft202012Validator(schema).validate(example)


def _references(part: Any) -> list[str]:
    if isinstance(part, dict):
        own = [part["$ref"]] if isinstance(part.get("$ref"), str) else []
        return own + [reference for value in part.values() for reference in _references(value)]
    if isinstance(part, list):
        return [reference for value in part for reference in _references(value)]
    return []


def test_the_exported_file_is_current() -> None:
    file = Path(asyncapi.__file__).parent / "json" / "asyncapi.json"
    assert json.loads(file.read_text()) == asyncapi.document()
