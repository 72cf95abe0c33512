"""The table of the fields of a pose: where an answer takes each of them from, and how it writes it.

Lists of poses, single poses and frames are all written from this table, in the order of the contract's models.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from dropanchor_schemas.pose import HeightSource as HeightName
from dropanchor_schemas.pose import Pose, PoseFrame, SigmaParts
from dropanchor_schemas.sentences import phrase_of
from dropanchor_service.answers.columns import REASONS, PoseColumns, ellipse_95
from dropanchor_service.answers.frames import FRAMES, STATES, OwnFrames
from dropanchor_service.answers.json_template import INTEGER, NUMBER, QUOTED, TEXT, null_for
from dropanchor_service.answers.kernels.json_numbers import BEYOND
from dropanchor_service.estimation.columns import Array, HeightSource, State
from dropanchor_service.store.floors import Floors

DECIMALS, FRAME_DECIMALS, FINE_DECIMALS = (
    6,
    4,
    9,
)  # digits of m, rad and s; of these in a frame; of variances and degrees

_AMBIGUOUS: Final = int(State.AMBIGUOUS)  # NumPy compares with an int faster than with an enum
_HEIGHT_SOURCES: Final = (None, *(HeightName[source.name].value for source in HeightSource))
COVARIANCE: Final = [[NUMBER] * 3] * 3
PARTS: Final = tuple(SigmaParts.model_fields)
_PARTS: Final = dict.fromkeys(PARTS, NUMBER)
ELLIPSE: Final = {"semi_major_m": NUMBER, "semi_minor_m": NUMBER, "angle_rad": NUMBER}


class JsonPart(NamedTuple):
    """One field in the JSON of n poses.

    forms: the forms that the field can have, with placeholders. form_of: index of the form of each pose, None: all
    have the first. numbers: for the placeholders, n or n × k. decimals: to which each number of a pose is rounded.
    """

    forms: Sequence[Any]
    form_of: Array | None = None
    numbers: tuple[Array, ...] = ()
    decimals: tuple[int, ...] = ()


Values = Sequence[Any] | Array | None


@dataclass(frozen=True)
class PoseField:
    """Three ways to write a field of n poses.

    json_part: in a list of poses. values: of single poses, with all digits. frame_values: in a frame, None where the
    frame does not have the field.
    """

    json_part: Callable[[PoseColumns], JsonPart]
    values: Callable[[PoseColumns], Sequence[Any]]
    frame_values: Callable[[PoseColumns], Values]


def number(
    column: Callable[[PoseColumns], Array | None], decimals: int = DECIMALS, frame_decimals: int = FRAME_DECIMALS
) -> PoseField:
    """Return the field of a float. column: returns the values, NaN where unknown, None if all are unknown."""

    def json_part(columns: PoseColumns) -> JsonPart:
        values = column(columns)
        return JsonPart([None]) if values is None else JsonPart([NUMBER], None, (values,), (decimals,))

    def all_digits(columns: PoseColumns) -> Sequence[Any]:
        values = column(columns)
        return [None] * len(columns.poses) if values is None else values.tolist()

    def rounded(columns: PoseColumns) -> Values:
        values = column(columns)
        return None if values is None else np.round(values, frame_decimals)

    return PoseField(json_part, all_digits, rounded)


def choice(choices: Callable[[PoseColumns], tuple[Sequence[Any], Array]]) -> PoseField:
    """Return the field of one of a few values. choices: returns these values and the index of that of each pose."""

    def values(columns: PoseColumns) -> Sequence[Any]:
        every, index = choices(columns)
        return [every[place] for place in index.tolist()]

    return PoseField(lambda columns: JsonPart(*choices(columns)), values, values)


def engine_number(name: str) -> PoseField:
    """Return the field of this float of POSE."""
    return number(lambda columns: columns.poses[name])


def _anchors(columns: PoseColumns) -> tuple[Sequence[str | None], Array]:
    ids, index = columns.anchor_ids, columns.poses["anchor"]
    return [None, *ids], (index + 1) * (index < len(ids))


def _covariance_json(columns: PoseColumns) -> JsonPart:
    numbers = columns.poses["cov"].reshape(-1, 9)
    known = (np.abs(numbers) < BEYOND).all(axis=1)
    return JsonPart([null_for(9), COVARIANCE], known, (numbers,), (FINE_DECIMALS,) * 9)


def covariance_values(cov: Array) -> list[list[list[float]] | None]:
    """Return each matrix (n, 3, 3), None where it is not finite."""
    known: Any = np.isfinite(cov).all(axis=(1, 2))
    return [matrix if finite else None for matrix, finite in zip(cov.tolist(), known.tolist(), strict=True)]


def _covariances(columns: PoseColumns) -> Sequence[Any]:
    return covariance_values(columns.poses["cov"])


def _ellipse_json(columns: PoseColumns) -> JsonPart:
    axes = (columns.semi_major_m, columns.semi_minor_m, columns.angle_rad)
    return JsonPart([null_for(3), ELLIPSE], columns.semi_major_m < BEYOND, axes, (DECIMALS,) * 3)


def _ellipses(columns: PoseColumns) -> Sequence[Any]:
    return ellipse_values(columns.semi_major_m, columns.semi_minor_m, columns.angle_rad)


def ellipse_values(major: Array, minor: Array, angle: Array) -> list[dict[str, Any] | None]:
    """Return an `Ellipse` for each, None where it is NaN."""
    return [
        {"semi_major_m": a, "semi_minor_m": b, "angle_rad": c} if a == a else None
        for a, b, c in zip(major.tolist(), minor.tolist(), angle.tolist(), strict=True)
    ]


def _parts_json(columns: PoseColumns) -> JsonPart:
    numbers = columns.poses["parts"]
    return JsonPart([null_for(len(PARTS)), _PARTS], _are_told(numbers), (numbers,), (DECIMALS,) * len(PARTS))


def _parts(columns: PoseColumns) -> Sequence[Any]:
    numbers = columns.poses["parts"]
    told = _are_told(numbers).tolist()
    return [
        dict(zip(PARTS, of_pose, strict=True)) if is_told else None
        for of_pose, is_told in zip(numbers.tolist(), told, strict=True)
    ]


def _are_told(parts: Array) -> Array:
    sums: Array = parts.sum(axis=1)
    return (sums > 0.0) & (sums < BEYOND)


def _hypotheses_json(columns: PoseColumns) -> JsonPart:
    ambiguous = columns.poses["state"] == _AMBIGUOUS
    return JsonPart([[], TEXT], ambiguous if columns.own is None else ambiguous & ~columns.own.is_known)


def _relative_json(columns: PoseColumns) -> JsonPart:
    return JsonPart([None]) if columns.own is None else relative_json(columns.own)


def relative_json(own: OwnFrames, decimals: int = DECIMALS) -> JsonPart:
    """Return the field `relative_pose`; the hypotheses of an ambiguous pose stand in it as a text."""
    poses, axes = own.poses, ellipse_95(own.poses["cov"])
    cov = poses["cov"].reshape(-1, 9)
    has_cov, has_ellipse = (np.abs(cov) < BEYOND).all(axis=1), axes[0] < BEYOND
    form_of = 1 + has_cov + 2 * has_ellipse + 4 * (poses["state"] == _AMBIGUOUS)
    numbers = (*(poses[name] for name in ("x", "y", "heading")), cov, *axes, poses["p_mode"], poses["sigma_pos"])
    digits = (*[decimals] * 3, *[FINE_DECIMALS] * 9, *[decimals] * 5)
    return JsonPart([null_for(len(digits)), *_RELATIVE_FORMS], np.where(own.is_known, form_of, 0), numbers, digits)


_HYPOTHESES: Final[tuple[Any, ...]] = ([], TEXT)
_RELATIVE_FORMS: Final[list[Any]] = [
    {"x": NUMBER, "y": NUMBER, "heading_rad": NUMBER, "covariance": covariance, "ellipse_95": ellipse}
    | {"p_mode": NUMBER, "sigma_pos_m": NUMBER, "hypotheses": hypotheses}
    for hypotheses in _HYPOTHESES
    for ellipse in (null_for(3), ELLIPSE)
    for covariance in (null_for(9), COVARIANCE)
]


def _relatives(columns: PoseColumns) -> Sequence[Any]:
    """Return the `RelativePose` of each pose without hypotheses, None where it has none."""
    if columns.own is None:
        return [None] * len(columns.poses)
    return relative_values(columns.own.poses, columns.own.is_known)


def relative_values(poses: Array, is_known: Array) -> list[dict[str, Any] | None]:
    """Return a `RelativePose` without hypotheses for each POSE, None where it is not known."""
    found: list[dict[str, Any] | None] = [None] * len(poses)
    own = poses[is_known]
    columns = {name: own[field].tolist() for name, field in _RELATIVE_NUMBERS.items()}
    columns["covariance"] = covariance_values(own["cov"])
    columns["ellipse_95"] = ellipse_values(*ellipse_95(own["cov"]))
    for place, values in zip(np.flatnonzero(is_known).tolist(), zip(*columns.values(), strict=True), strict=True):
        found[place] = dict(zip(columns, values, strict=True)) | {"hypotheses": []}
    return found


_RELATIVE_NUMBERS: Final = {
    "x": "x",
    "y": "y",
    "heading_rad": "heading",
    "p_mode": "p_mode",
    "sigma_pos_m": "sigma_pos",
}


def height_sources(poses: Array) -> tuple[Sequence[str | None], Array]:
    """Return all sources of heights, and the index of that of each POSE or POINT."""
    return _HEIGHT_SOURCES, np.where(np.isfinite(poses["z"]), 1 + poses["z_source"], 0)


def height_source_values(poses: Array) -> list[str | None]:
    """Return the source of the height of each POSE or POINT."""
    every, index = height_sources(poses)
    return [every[place] for place in index.tolist()]


def floor_columns(floors: Floors, poses: Array) -> dict[str, list[Any]]:
    """Return the columns `floor` and `floor_probability` of POSE or POINT."""
    floor, probability = floors.likeliest(poses)
    names = [*floors.names, None]
    return {
        "floor": [names[number] for number in floor.tolist()],
        "floor_probability": np.round(probability, DECIMALS).tolist(),
    }


def _nulls(columns: PoseColumns) -> Sequence[None]:
    return [None] * len(columns.poses)


def _tags(columns: PoseColumns) -> Sequence[str]:
    return columns.tags


def _epochs(columns: PoseColumns) -> Sequence[int]:
    return [columns.epoch] * len(columns.poses)


def _times(columns: PoseColumns) -> Sequence[int]:
    return columns.poses["t_ns"].tolist()  # type: ignore[no-any-return]


_TABLE: Final = {
    "tag": PoseField(lambda _: JsonPart([QUOTED]), _tags, _tags),
    "t_ns": PoseField(lambda _: JsonPart([INTEGER]), _times, _times),
    "age_s": number(lambda columns: columns.age_s, frame_decimals=3),
    "state": choice(lambda columns: (STATES, columns.poses["state"])),
    "reason": choice(lambda columns: (REASONS, columns.poses["reason"])),
    "hint": choice(lambda columns: (columns.hint_texts, columns.hint)),
    "hint_phrase": choice(lambda columns: (list(map(phrase_of, columns.hint_texts)), columns.hint)),
    "frame": choice(lambda columns: (FRAMES, columns.poses["frame"])),
    "relative_pose": PoseField(_relative_json, _relatives, _nulls),  # in frames, as the hypotheses
    "x": engine_number("x"),
    "y": engine_number("y"),
    "z": engine_number("z"),
    "z_std_m": engine_number("z_std"),
    "z_source": choice(lambda columns: height_sources(columns.poses)),
    "floor": choice(lambda columns: ([None, *columns.floor_names], columns.floor + 1)),
    "floor_probability": number(lambda columns: columns.floor_probability),
    "heading_rad": engine_number("heading"),
    "speed_mps": engine_number("speed"),
    "yaw_rate_radps": engine_number("yaw_rate"),
    "covariance": PoseField(_covariance_json, _covariances, _covariances),
    "ellipse_95": PoseField(_ellipse_json, _ellipses, _ellipses),
    "semi_major_m": number(lambda columns: columns.semi_major_m),
    "semi_minor_m": number(lambda columns: columns.semi_minor_m),
    "angle_rad": number(lambda columns: columns.angle_rad),
    "p_mode": engine_number("p_mode"),
    "sigma_pos_m": engine_number("sigma_pos"),
    "sigma_parts": PoseField(_parts_json, _parts, _nulls),  # not in frames
    "sigma_obs_m": engine_number("sigma_obs"),
    "range_m": engine_number("range"),
    "anchor": choice(_anchors),
    "hypotheses": PoseField(_hypotheses_json, _nulls, _nulls),  # the values come from another table of the store
    "lat": number(lambda columns: columns.lat, FINE_DECIMALS, FINE_DECIMALS),
    "lon": number(lambda columns: columns.lon, FINE_DECIMALS, FINE_DECIMALS),
    "alt_m": number(lambda columns: columns.alt_m),
    "online": choice(lambda columns: ([False, True], columns.online)),
    "epoch": PoseField(lambda columns: JsonPart([columns.epoch]), _epochs, _epochs),
}

POSE_FIELDS: Final = {name: _TABLE[name] for name in Pose.model_fields}
_IN_FRAMES: Final = {"tags": _TABLE["tag"]} | _TABLE
FRAME_FIELDS: Final = {
    name: _IN_FRAMES[name] for name in PoseFrame.model_fields if name not in ("t_ns", "epoch")
}  # of these it has one for all
