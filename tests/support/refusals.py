"""The sentences with which the service refuses a change that the page sends.

The code is read for sentences without a code. Those of Pydantic come from wrong values in every place of the models.
"""

import ast
import copy
import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

import dropanchor_schemas
import dropanchor_service
from dropanchor_schemas.destinations import Destination
from dropanchor_schemas.plans import Plan
from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_schemas.zones import EventRule, Zone
from dropanchor_service.api.http.errors import message_of
from dropanchor_service.api.routes import event_examples, examples, plan_examples

SERVICE = Path(dropanchor_service.__file__).parent
SCHEMAS = Path(dropanchor_schemas.__file__).parent
FOLDERS = ("api/http", "api/routes", "delivery", "plans", "security", "zones")
FILES = (
    SERVICE / "store/site.py",
    *(SCHEMAS / f"{name}.py" for name in ("destinations", "file_names", "keys", "plans", "shares", "site")),
)
NOT_SHOWN = {
    "the page reads these, and has words of its own for a failure": (
        *("basemap", "events", "figures", "heat_map", "period", "poses", "track_file", "tracks", "site_of_request"),
    ),
    "only programs use these": (
        *("features", "ingest", "ingest_health", "ingest_phyphox", "recordings", "remote_settings", "oidc"),
    ),
    "these speak while the service starts, and not to the page": ("health", "folder", "authority", "certificate"),
}
"""Modules whose refusals the page does not show, by the reason."""
SAYING = {
    *("ProblemError", "problem_response", "RefusedError", "UnplacedError", "ShapeError", "ChannelError"),
    *(
        "UrlError",
        "RefusedAddressError",
        "SecretError",
        "UnauthenticatedError",
        "ValueError",
        "InvalidKeyError",
        "_unauthenticated",
        "_ClosedError",
    ),
}
"""What is called with a sentence, as its last text."""

WRONG: tuple[Any, ...] = (
    *(None, "", " ", "x" * 3000, "\n", "-", -1e12, 1e12, math.nan, -1, 1.5, True, {}, [], [[]], [1] * 300),
    *([[0.0, 0.0, 0.0]] * 3, ["a"] * 11_000, [" "], {"type": "other"}),
)
BODIES: tuple[tuple[Any, Any], ...] = (
    (Zone, event_examples.ZONE),
    (Zone, event_examples.ZONE | {"shape": {"type": "circle", "x": 1.0, "y": 2.0, "radius_m": 3.0}}),
    (EventRule, event_examples.RULE),
    (EventRule, {"id": "low", "type": "battery_low", "fraction": 0.2}),
    (EventRule, {"id": "lost", "type": "lost", "after_s": 60.0}),
    (Destination, event_examples.WEBHOOK),
    (Destination, {"id": "shift", "type": "email", "to": ["shift@example.com"], "language": "en", "digest_s": 60}),
    (Destination, {"id": "broker", "type": "mqtt", "topic": "yard/{tag}"}),
    (Destination, {"id": "broker", "type": "mqtt_poses", "prefix": "yard", "discovery": ""}),
    (TagSettings, examples.TAG_SETTINGS),
    (Anchor, examples.ANCHOR),
    (Site, examples.SITE),
    (Site, {"anchors": [{"id": "1"}, {"id": "1"}]}),
    (Plan, plan_examples.PLAN),
    (ShareRequest, {"name": "Visitors", "valid_s": 3600, "tag": "a", "view": "zoom=2"}),
    (ShareRequest, {"tag": "a", "group": "b"}),
)


def refusals_without_a_code() -> set[str]:
    """Return the sentences in the code that the page may show although it cannot know them."""
    hidden = {name for names in NOT_SHOWN.values() for name in names}
    folders = [SERVICE / folder for folder in FOLDERS]
    files = [file for folder in folders for file in sorted(folder.rglob("*.py")) if file.stem not in hidden]
    return {text for file in (*files, *FILES) for text in _sentences(file)}


def sentences_about_bodies() -> set[str]:
    """Return what is said about wrong values in the bodies of requests."""
    return {text for model, example in BODIES for text in _about(TypeAdapter(model), example)}


def _sentences(file: Path) -> Iterator[str]:
    tree = ast.parse(file.read_text())
    texts = _texts_by_name(tree)
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call) or not call.args:
            continue
        name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
        for said in _choices(call.args[-1], texts) if name in SAYING else ():
            text = _text_of(said)
            if any(letter.isalpha() for letter in text):
                yield f"{file.name}: {text}"


def _texts_by_name(tree: ast.Module) -> dict[str, list[ast.expr]]:
    """Return what variables are set to and functions return, by their names."""
    texts = defaultdict[str, list[ast.expr]](list)
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name):
                    texts[target.id].append(node.value)
        elif isinstance(node, ast.FunctionDef):
            texts[node.name] += [part.value for part in ast.walk(node) if isinstance(part, ast.Return) and part.value]
    return texts


def _choices(node: ast.expr, texts: dict[str, list[ast.expr]]) -> list[ast.expr]:
    """Return the expressions that a text can come from."""
    match node:
        case ast.IfExp(body=body, orelse=orelse):
            return [*_choices(body, texts), *_choices(orelse, texts)]
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name)) if name in texts:
            return texts[name]
    return [node]


def _text_of(node: ast.expr) -> str:
    """Return the text that an expression holds itself."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(map(_text_of, parts))
    return ""


def _about(adapter: TypeAdapter[Any], example: Any) -> Iterator[str]:
    for wrong in _spoilt(example):
        try:
            adapter.validate_python(wrong)
        except ValidationError as error:
            yield from (message_of(part) for part in error.errors())


def _spoilt(value: Any) -> Iterator[Any]:
    """Yield the value as it is, and with one wrong, missing or unknown part."""
    yield value
    yield from WRONG
    if isinstance(value, dict):
        yield value | {"unknown": 1}
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    for key in keys:
        if isinstance(value, dict):
            yield {name: part for name, part in value.items() if name != key}
        for part in _spoilt(value[key]):
            spoilt = copy.copy(value)
            spoilt[key] = part
            yield spoilt
