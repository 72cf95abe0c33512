"""Read the settings from a TOML file, the environment and the command line. Each overrides the one before."""

import difflib
import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from dropanchor_schemas.site import Typed
from dropanchor_service.settings.former_names import FORMER, with_present_names
from dropanchor_service.settings.layers import Layer
from dropanchor_service.settings.model import Settings

ENVIRONMENT_PREFIX = "DROPANCHOR_"
ENVIRONMENT_DELIMITER = "__"


class SettingsError(ValueError):
    """The settings are invalid. The message names the source, the key and the expected value."""


def load_settings(
    file: Path | None = None,
    options: Mapping[str, Any] | None = None,
    environment: Mapping[str, str] = os.environ,
) -> Settings:
    """Return the settings from the file, the environment and the nested options, in ascending priority.

    Raises SettingsError.
    """
    given = [
        Layer("file", _from_file(file), None if file is None else str(file)),
        Layer("environment", _from_environment(environment)),
        Layer("command_line", dict(options or {})),
    ]
    layers = [layer._replace(values=with_present_names(layer.name, layer.values)) for layer in given]
    merged: dict[str, Any] = {}
    for layer in layers:
        merged = _merged(merged, layer.values)
    try:
        return Settings.model_validate(merged).loaded_from(layers)
    except ValidationError as error:
        raise SettingsError("\n".join(_message(entry, layers) for entry in error.errors())) from error


def _from_file(file: Path | None) -> dict[str, Any]:
    if file is None:
        return {}
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"{file}: is not a UTF-8 text file") from error
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"{file}: is not TOML: {error}") from error


def _from_environment(environment: Mapping[str, str]) -> dict[str, Any]:
    """Return the settings in the environment: `DROPANCHOR_HTTP__PORT=8081` sets `port` in `[http]`.

    Lists and tables are JSON. Other variables with the prefix are ignored, unless they contain the delimiter.
    """
    found: dict[str, Any] = {}
    for variable, text in environment.items():
        if not variable.startswith(ENVIRONMENT_PREFIX):
            continue
        path = variable.removeprefix(ENVIRONMENT_PREFIX).lower().split(ENVIRONMENT_DELIMITER)
        if len(path) > 1 or path[0] in Settings.model_fields or tuple(path) in FORMER:
            found = _merged(found, _nested(path, _value(variable, text)))
    return found


def _value(variable: str, text: str) -> Any:
    if not text.lstrip().startswith(("[", "{")):
        return Typed(text)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise SettingsError(f"environment variable {variable}: is not valid JSON: {error}") from error


def _nested(path: list[str], value: Any) -> dict[str, Any]:
    return {path[0]: _nested(path[1:], value) if len(path) > 1 else value}


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = _merged(merged[key], value) if both else value
    return merged


def _message(error: Any, layers: Sequence[Layer]) -> str:
    """Return one line with the source, the key and what is expected, without the value, which may be a secret."""
    path = [str(part) for part in error["loc"] if part != "[key]"]  # pydantic adds this when the key itself is wrong
    given = [layer for layer in reversed(layers) if layer.values]
    source = max(given, key=lambda layer: _depth(layer.values, path)).name
    key = ".".join(path) or "the settings together"
    if error["type"] == "extra_forbidden":
        return f"{source}: {key} is not a setting{_suggestion(path)}"
    return f"{source}: {key}: {error['msg'].removeprefix('Value error, ')}"


def _depth(layer: Any, path: list[str]) -> int:
    """Return how many parts of the path the layer contains."""
    if not path or not isinstance(layer, Mapping) or path[0] not in layer:
        return 0
    return 1 + _depth(layer[path[0]], path[1:])


def _suggestion(path: list[str]) -> str:
    """Return "; did you mean ...?" when a setting has a similar name, else nothing."""
    model: type[BaseModel] = Settings
    for part in path[:-1]:
        field = model.model_fields.get(part)  # None for the id of a tag and the index in a list
        model = model if field is None else model_in(field.annotation) or model
    close = difflib.get_close_matches(path[-1], model.model_fields, 1)
    return f"; did you mean {close[0]}?" if close else ""


def model_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model that an annotation is, or holds in a list, a dict or an optional."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (model_in(argument) for argument in get_args(annotation))
    return next((model for model in found if model is not None), None)
