"""The page of the fields of poses and figures: what each is called, and its type in every format."""

from collections.abc import Mapping
from typing import Any

import pyarrow as pa
from pydantic import BaseModel

from dropanchor_evaluation.reference.markdown import table
from dropanchor_schemas.figures import Figures
from dropanchor_schemas.pose import PoseFrame, TimedPose
from dropanchor_schemas.site import Georeference, Site
from dropanchor_schemas.track import TrackPose
from dropanchor_schemas.tracks import TagSummary
from dropanchor_service.api.formats.parquet import schema_of
from dropanchor_service.api.formats.tables import FIGURES
from dropanchor_service.api.formats.track import COVARIANCES, NESTED, RELATIVES
from dropanchor_service.recording.schemas import ESTIMATE, all_schemas

Kinds = dict[str, str]
"""The type of each field, by its name."""

_KINDS = {"integer": "integer", "number": "number", "string": "text", "boolean": "boolean", "object": "object"}
_TITLE = "# Fields of poses and figures\n"
_INTRODUCTION = f"""\
A field has one name, one type and one unit, wherever it appears: over REST and Zenoh, in files, and in recordings. SI
units and radians. `t_ns` is an integer, UTC in ns; `t_utc` is the same time for people, as ISO 8601, and in Parquet a
timestamp. Ids such as `tag` and `anchor` are texts, also where they look like numbers. In CSV, an unknown value is an
empty cell; in JSON and Parquet it is null. [How to read exports](../how-to/read-exports.md) in Python and DuckDB.

A GeoJSON feature has the fields of JSON as properties. GPX holds only latitude, longitude, altitude, `time` and
state; KML has no state.
CSV and Parquet have the covariance as {", ".join(f"`{name}`" for name in COVARIANCES)}: m², m·rad and rad²,
and `relative_pose` as columns that begin with `relative_`. In a recording `covariance` has nine numbers, row by row.
`lat` and `lon` exist in a track if the site is georeferenced, and `alt_m` if its georeference has one, too.
"""
_COLUMNS = "in columns: each is a list with one entry for each tag"


def of_poses() -> dict[str, Kinds]:
    """Return the types of the fields of a pose, by format."""
    site = Site(georeference=Georeference(lat=0.0, lon=0.0, alt_m=0.0))
    return {
        "pose, JSON": _of_model(TimedPose),
        "stream": {name: kind.removeprefix("list of ") for name, kind in _of_model(PoseFrame).items()},
        "track, JSON": _of_model(TrackPose),
        "track, CSV": of_csv(),
        "track, Parquet": {field.name: of_arrow(field.type) for field in schema_of("", site)},
        "recording, MCAP": {name: _kind(part) for name, part in all_schemas()[ESTIMATE]["properties"].items()},
    }


def of_csv() -> Kinds:
    """Return the types of the columns of a track as CSV."""
    plain = {name: kind for name, kind in _of_model(TrackPose).items() if name not in NESTED}
    return plain | dict.fromkeys([*COVARIANCES, *RELATIVES], "number")


def of_figures() -> dict[str, Kinds]:
    """Return the types of the figures of a tag, by format."""
    in_json = _of_model(Figures.model_fields["tags"].annotation.__args__[0])  # type: ignore[union-attr]
    return {
        "figures, JSON": in_json,
        "figures, CSV": {name: in_json[name] for name in ("tag", *FIGURES)},
        "tracks, JSON": _of_model(TagSummary),
    }


def of_arrow(kind: pa.DataType) -> str:
    """Return the type of a column of Parquet."""
    if pa.types.is_timestamp(kind):
        return "timestamp"
    if pa.types.is_integer(kind):
        return "integer"
    return "number" if pa.types.is_floating(kind) else "text"


def page() -> str:
    tables = ((_POSES, of_poses()), (_FIGURES, of_figures()))
    return "\n".join([_TITLE, _INTRODUCTION, *(f"{title}\n{_table(kinds)}" for title, kinds in tables)])


_POSES = f"""\
## Poses

`GET …/pose`, `…/poses` and Zenoh give JSON; `/stream` and the Zenoh key `…/poses` give a `PoseFrame` {_COLUMNS}.
"""
_FIGURES = """\
## Figures

The CSV of figures also has `from_utc` and `to_utc`, and for each zone a column of the seconds in it.
"""


def _table(kinds: Mapping[str, Kinds]) -> str:
    names = dict.fromkeys(name for fields in kinds.values() for name in fields)
    rows = [[f"`{name}`", *(fields.get(name, "") for fields in kinds.values())] for name in names]
    return table(["field", *kinds], rows)


def _of_model(model: type[BaseModel]) -> Kinds:
    schema = model.model_json_schema()
    return {name: _kind(part, schema.get("$defs", {})) for name, part in schema["properties"].items()}


def _kind(part: Mapping[str, Any], models: Mapping[str, Any] = {}) -> str:
    """Return the type of a part of a JSON Schema. Null is no type: any value may be unknown."""
    if "$ref" in part:
        return _kind(models[part["$ref"].rpartition("/")[2]], models)
    if "anyOf" in part:
        return next(_kind(one, models) for one in part["anyOf"] if one.get("type") != "null")
    if part["type"] == "array":
        return f"list of {_kind(part['items'], models)}"
    return _KINDS[part["type"]]
