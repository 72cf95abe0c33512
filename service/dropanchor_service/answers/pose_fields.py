"""The table of the fields of a pose: where an answer takes each of them from, and how it writes it.

Lists of poses, single poses and frames are all written from this table, in the order of the contract's models.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from dropanchor_schemas.pose import Pose, PoseFrame
from dropanchor_service.answers.columns import FRAMES, REASONS, STATES, PoseColumns
from dropanchor_service.answers.json_template import INTEGER, NUMBER, QUOTED, TEXT, null_for
from dropanchor_service.answers.kernels.json_numbers import BEYOND
from dropanchor_service.estimation.columns import Array, State

DECIMALS, FINE_DECIMALS = 6, 9  # digits of m, rad and s; of variances and degrees

_AMBIGUOUS: Final = int(State.AMBIGUOUS)  # NumPy compares with an int faster than with an enum
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
    column: Callable[[PoseColumns], Array | None], decimals: int = DECIMALS, frame_decimals: int = 4
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
    return JsonPart([null_for(9), [[NUMBER] * 3] * 3], known, (numbers,), (FINE_DECIMALS,) * 9)


def _covariances(columns: PoseColumns) -> Sequence[Any]:
    cov = columns.poses["cov"]
    known = np.isfinite(cov).all(axis=(1, 2))
    return [matrix if finite else None for matrix, finite in zip(cov.tolist(), known.tolist(), strict=True)]


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


def _hypotheses_json(columns: PoseColumns) -> JsonPart:
    return JsonPart([[], TEXT], columns.poses["state"] == _AMBIGUOUS)


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
    "frame": choice(lambda columns: (FRAMES, columns.poses["frame"])),
    "x": engine_number("x"),
    "y": engine_number("y"),
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
    "sigma_obs_m": engine_number("sigma_obs"),
    "range_m": engine_number("range"),
    "anchor": choice(_anchors),
    "hypotheses": PoseField(_hypotheses_json, _nulls, _nulls),  # the values come from another table of the store
    "lat": number(lambda columns: columns.lat, FINE_DECIMALS, FINE_DECIMALS),
    "lon": number(lambda columns: columns.lon, FINE_DECIMALS, FINE_DECIMALS),
    "online": choice(lambda columns: ([False, True], columns.online)),
    "epoch": PoseField(lambda columns: JsonPart([columns.epoch]), _epochs, _epochs),
}

POSE_FIELDS: Final = {name: _TABLE[name] for name in Pose.model_fields}
_IN_FRAMES: Final = {"tags": _TABLE["tag"]} | _TABLE
FRAME_FIELDS: Final = {
    name: _IN_FRAMES[name] for name in PoseFrame.model_fields if name not in ("t_ns", "epoch")
}  # of these it has one for all
