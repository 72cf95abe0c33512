"""Write many poses as the JSON of the contract, from columns.

The result equals that of `to_json` for the same poses as dictionaries, but without digits beyond the accuracy.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import orjson

from dropanchor_service.answers.columns import REASONS, STATES, PoseColumns, ellipse_95
from dropanchor_service.answers.json_template import INTEGER, NUMBER, QUOTED, TEXT, Filled, filled, null_for
from dropanchor_service.answers.kernels.json_numbers import BEYOND
from dropanchor_service.estimation.columns import Array, State

CHUNK = 2500  # poses
DECIMALS, FINE_DECIMALS = 6, 9  # digits of m, rad and s; of variances and degrees

_DECIMALS = np.repeat([DECIMALS, FINE_DECIMALS, DECIMALS, FINE_DECIMALS], [6, 9, 7, 2])  # of the columns of _numbers
_COVARIANCE = [[NUMBER] * 3] * 3
_ELLIPSE = {"semi_major_m": NUMBER, "semi_minor_m": NUMBER, "angle_rad": NUMBER}


def poses_json(columns: PoseColumns, hypotheses: Iterable[bytes]) -> Filled:
    """Return the JSON of a `Pose` for each. hypotheses: JSON of those of each ambiguous pose."""
    codes = _codes(columns)
    used, form_of = np.unique(codes, return_inverse=True)
    forms = [_form(columns, code) for code in used.tolist()]
    texts = _texts(columns, hypotheses)
    return filled(forms, form_of, _numbers(columns), _DECIMALS, columns.poses["t_ns"], texts)


def list_json(t_ns: int, chunks: Iterable[Filled]) -> Iterator[bytes | memoryview]:
    """Yield the JSON of a `PoseList` of these poses, in chunks."""
    yield b'{"t_ns":%d,"poses":[' % t_ns
    for place, chunk in enumerate(chunks):
        yield chunk.text if place else chunk.all
    yield b"]}"


def hypotheses_json(modes: Array, counts: Array) -> list[bytes]:
    """Return the JSON of the list of `Hypothesis` of each tag. counts: number of HYPOTHESIS of each tag."""
    axes = ellipse_95(modes["cov"])
    numbers = np.column_stack([modes[name] for name in ("weight", "x", "y", "heading", "speed")] + list(axes))
    forms = [_hypothesis(ellipse) for ellipse in (null_for(3), _ELLIPSE)]
    each = filled(forms, (axes[0] < BEYOND).astype(np.int64), numbers, np.full(8, DECIMALS)).each
    ends = np.cumsum(counts).tolist()
    return [b"[%b]" % b",".join(each[begin:end]) for begin, end in zip([0, *ends], ends, strict=False)]


def _hypothesis(ellipse: Any) -> bytes:
    scalars = dict.fromkeys(("weight", "x", "y", "heading_rad", "speed_mps"), NUMBER)
    return orjson.dumps(scalars | {"ellipse_95": ellipse})


def _codes(columns: PoseColumns) -> Array:
    """Return a code for each pose that holds everything its form depends on."""
    poses = columns.poses
    known = (np.abs(poses["cov"].reshape(-1, 9)) < BEYOND).all(axis=1)
    anchor = np.where((poses["anchor"] >= 0) & (poses["anchor"] < len(columns.anchor_ids)), poses["anchor"], -1)
    flags = columns.online * 4 + known * 2 + (columns.semi_major_m < BEYOND)
    states = poses["state"].astype(np.int64) * len(REASONS) + poses["reason"]
    hinted = columns.hint.astype(np.int64) * (len(columns.anchor_ids) + 1) + anchor + 1
    codes: Array = (hinted * len(STATES) * len(REASONS) + states) * 8 + flags
    return codes


def _form(columns: PoseColumns, code: int) -> bytes:
    """Return the form of the poses with this code."""
    code, flags = divmod(code, 8)
    code, reason = divmod(code, len(REASONS))
    code, state = divmod(code, len(STATES))
    hint, anchor = divmod(code, len(columns.anchor_ids) + 1)
    place = NUMBER if columns.lat is not None else None
    return orjson.dumps(
        {"tag": QUOTED, "t_ns": INTEGER, "age_s": NUMBER}
        | {"state": STATES[state], "reason": REASONS[reason], "hint": columns.hint_texts[hint]}
        | dict.fromkeys(("x", "y", "heading_rad", "speed_mps", "yaw_rate_radps"), NUMBER)
        | {"covariance": _COVARIANCE if flags & 2 else null_for(9)}
        | {"ellipse_95": _ELLIPSE if flags & 1 else null_for(3)}
        | dict.fromkeys(("p_mode", "sigma_pos_m", "sigma_obs_m", "range_m"), NUMBER)
        | {"anchor": columns.anchor_ids[anchor - 1] if anchor else None}
        | {"hypotheses": TEXT if state == State.AMBIGUOUS else []}
        | {"lat": place, "lon": place, "online": bool(flags & 4)}
    )


def _numbers(columns: PoseColumns) -> Array:
    """Return the numbers of each pose, in the order of the placeholders of a form."""
    poses = columns.poses
    return np.column_stack(
        [columns.age_s]
        + [poses[name] for name in ("x", "y", "heading", "speed", "yaw_rate")]
        + [poses["cov"].reshape(-1, 9), columns.semi_major_m, columns.semi_minor_m, columns.angle_rad]
        + [poses[name] for name in ("p_mode", "sigma_pos", "sigma_obs", "range")]
        + [column for column in (columns.lat, columns.lon) if column is not None]
    )


def _texts(columns: PoseColumns, hypotheses: Iterable[bytes]) -> Sequence[bytes]:
    """Return the tag of each pose, without the quotes, followed by its hypotheses if the pose is ambiguous."""
    # Quotes inside a string are escaped, so `","` occurs only between two strings.
    tags = orjson.dumps(columns.tags)[2:-2].split(b'","') if columns.tags else []
    ambiguous = columns.poses["state"] == State.AMBIGUOUS
    if not ambiguous.any():
        return tags
    of_each = iter(hypotheses)
    pairs = (
        (tag, next(of_each)) if is_ambiguous else (tag,)
        for tag, is_ambiguous in zip(tags, ambiguous.tolist(), strict=True)
    )
    return [text for pair in pairs for text in pair]
