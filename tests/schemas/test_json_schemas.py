"""The exported JSON Schemas are valid and current, and agree with the decoders."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from dropanchor_schemas import export
from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.samples import SamplesMessage, decode_json
from dropanchor_schemas.wire import Frame, encode_json
from support.payloads import frames

NAMES = sorted(export.MODELS)


def schema(name: str) -> dict[str, Any]:
    value: dict[str, Any] = json.loads((export.FOLDER / f"{name}.schema.json").read_text())
    return value


SAMPLES = Draft202012Validator(schema("samples"))


@pytest.mark.parametrize("name", NAMES)
def test_every_schema_is_valid(name: str) -> None:
    Draft202012Validator.check_schema(schema(name))


def test_every_schema_is_current_and_no_other_file_is_in_the_folder() -> None:
    assert export.main(["--check"]) == 0
    assert sorted(export.FOLDER.glob("*.json")) == sorted(export.schemas())


def test_the_check_reports_schemas_that_are_not_current(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(export, "FOLDER", tmp_path)
    assert export.main(["--check"]) == 1
    assert "samples.schema.json" in capsys.readouterr().err
    assert export.main([]) == 0
    assert export.main(["--check"]) == 0
    (tmp_path / "pose.schema.json").write_text("{}")
    assert export.main(["--check"]) == 1
    assert "not current: pose.schema.json;" in capsys.readouterr().err


@pytest.mark.parametrize("name", NAMES)
def test_examples_validate(name: str) -> None:
    for example in schema(name).get("examples", []):
        Draft202012Validator(schema(name)).validate(example)
        assert export.MODELS[name].model_validate_json(json.dumps(example))


def test_the_examples_of_samples_decode() -> None:
    examples = SamplesMessage.model_json_schema()["examples"]
    assert len(examples) >= 2
    for example in examples:
        assert isinstance(decode_json(json.dumps(example).encode()), Frame)


@given(frames())
def test_what_a_tag_encodes_is_valid(frame: Frame) -> None:
    SAMPLES.validate(json.loads(encode_json(frame)))


def places(value: Any) -> list[tuple[Any, Any]]:
    """Return every (container, key) pair inside a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, inner in items for place in [(value, key), *places(inner)]]


WRONG: list[Any] = [None, True, -1, 0, 1, 2**32, 2**62, 0.5, "", "7", "utc", "x" * 65, [], [0, 0, 0], [{}], {}]


@given(frames(), st.sampled_from(WRONG), st.data())
def test_the_schema_and_the_decoder_reject_the_same_messages(frame: Frame, value: Any, data: st.DataObject) -> None:
    message = json.loads(encode_json(frame))
    container, key = data.draw(st.sampled_from(places(message)))
    if data.draw(st.booleans()):
        container[key] = deepcopy(value)
    elif isinstance(container, dict):
        container[data.draw(st.sampled_from(["extra", "mag", "std_m", "boot_id"]))] = deepcopy(value)
    else:
        del container[key]
    decoded = decode_json(json.dumps(message).encode())
    empty = not any(message.get(kind.name) for kind in KINDS)
    assert SAMPLES.is_valid(message) == (isinstance(decoded, Frame) or (empty and decoded.reason == "no_samples"))
