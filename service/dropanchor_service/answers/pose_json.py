"""Write many poses as the JSON of the contract, from columns.

The result equals that of `to_json` for the same poses as dictionaries, but without digits beyond the accuracy.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import orjson

from dropanchor_service.answers.columns import PoseColumns, ellipse_95
from dropanchor_service.answers.frames import OwnFrames
from dropanchor_service.answers.json_template import NUMBER, Filled, filled, null_for
from dropanchor_service.answers.kernels.json_numbers import BEYOND
from dropanchor_service.answers.pose_fields import (
    DECIMALS,
    ELLIPSE,
    FRAME_DECIMALS,
    POSE_FIELDS,
    JsonPart,
    relative_json,
)
from dropanchor_service.estimation.columns import Array, State

CHUNK = 2500  # poses


def poses_json(columns: PoseColumns, hypotheses: Iterable[bytes]) -> Filled:
    """Return the JSON of a `Pose` for each. hypotheses: JSON of those of each ambiguous pose."""
    parts = {name: field.json_part(columns) for name, field in POSE_FIELDS.items()}
    forms, form_of = _forms(parts)
    numbers = np.column_stack([column for part in parts.values() for column in part.numbers])
    decimals = np.array([decimals for part in parts.values() for decimals in part.decimals])
    return filled(forms, form_of, numbers, decimals, columns.poses["t_ns"], _texts(columns, hypotheses))


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
    forms = [_hypothesis(ellipse) for ellipse in (null_for(3), ELLIPSE)]
    each = filled(forms, (axes[0] < BEYOND).astype(np.int64), numbers, np.full(8, DECIMALS)).each
    ends = np.cumsum(counts).tolist()
    return [b"[%b]" % b",".join(each[begin:end]) for begin, end in zip([0, *ends], ends, strict=False)]


def relative_poses_json(own: OwnFrames, hypotheses: Sequence[bytes]) -> list[orjson.Fragment | None]:
    """Return the JSON of a `RelativePose` for each, as in a frame; None where it is not known.

    hypotheses: JSON of those of each that is ambiguous.
    """
    known = own.is_known
    part = relative_json(OwnFrames(own.poses[known], known[known]), FRAME_DECIMALS)
    assert part.form_of is not None
    forms = [orjson.dumps(form) for form in part.forms]
    each = filled(forms, part.form_of, np.column_stack(part.numbers), np.array(part.decimals), None, hypotheses).each
    found: list[orjson.Fragment | None] = [None] * len(known)
    for place, text in zip(np.flatnonzero(known).tolist(), each, strict=True):
        found[place] = orjson.Fragment(text)
    return found


def _hypothesis(ellipse: Any) -> bytes:
    scalars = dict.fromkeys(("weight", "x", "y", "heading_rad", "speed_mps"), NUMBER)
    return orjson.dumps(scalars | {"ellipse_95": ellipse})


def _forms(parts: dict[str, JsonPart]) -> tuple[list[bytes], Array]:
    """Return the forms of poses that occur, and the index of that of each pose."""
    varied = {name: part.forms for name, part in parts.items() if part.form_of is not None}
    choices = np.column_stack([part.form_of for part in parts.values() if part.form_of is not None])
    codes = choices @ np.cumprod([1, *map(len, varied.values())])[:-1]
    used, form_of = np.unique(codes, return_inverse=True)
    examples = np.empty(len(used), np.int64)  # one pose of each form
    examples[form_of] = np.arange(len(codes))
    fixed = {name: part.forms[0] for name, part in parts.items()}
    return [_form(fixed, varied, chosen) for chosen in choices[examples].tolist()], form_of


def _form(fixed: dict[str, Any], varied: dict[str, Sequence[Any]], chosen: list[int]) -> bytes:
    """Return the JSON of a pose with `fixed` and with the chosen one of each `varied` field."""
    return orjson.dumps(
        fixed | {name: forms[choice] for (name, forms), choice in zip(varied.items(), chosen, strict=True)}
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
