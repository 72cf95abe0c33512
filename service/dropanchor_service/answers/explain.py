"""Explain the latest pose of a tag: build the answer `Explanation`."""

import numpy as np

from dropanchor_schemas.explain import MeasurementKind as KindName
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.answers.north import cure_by_others, north_error_of
from dropanchor_service.answers.uncertainty import uncertainty_of
from dropanchor_service.estimation.columns import Array, MeasurementKind
from dropanchor_service.store.tags import Tag

RATE_NS = 2_000_000_000  # window of the range rate
MIN_RANGES = 4  # of a range rate
MINUTE_NS = 60_000_000_000

_HEIGHT_TRACK = {"t_ns": "t_ns", "z": "z", "z_std_m": "z_std"}
_KINDS = [KindName[kind.name].value for kind in MeasurementKind]


def explanation_of(answers: Answers, tag: Tag, last: int) -> Answer | None:
    """Return the `Explanation` of a tag with its last innovations, None before its first pose."""
    pose = answers.pose_of(tag)
    if pose is None:
        return None
    innovations = answers.latest.innovations(tag.row)
    history = answers.latest.history(tag.row)
    minute = history[history["t_ns"] > pose["t_ns"] - MINUTE_NS]
    latest = innovations[-last:]
    return {
        "pose": pose,
        "hypotheses": pose["hypotheses"],
        "speed": {"speed_mps": pose["speed_mps"]} | _rates(innovations),
        "speed_track": {"t_ns": minute["t_ns"].tolist(), "speed_mps": minute["speed"].tolist()},
        "height_track": {field: minute[name].tolist() for field, name in _HEIGHT_TRACK.items()},
        "uncertainty": uncertainty_of(pose, answers.site.tag_settings(tag.name), cure_by_others(answers, tag)),
        "north": north_error_of(answers, tag),
        "innovations": _innovations(latest, [anchor.id for anchor in answers.site.anchors_by_index()]),
        "range_errors": _range_errors(innovations),
        "refused": int(np.count_nonzero(~latest["fused"])),
        "samples": dict(tag.samples),
        "arrived": dict(tag.arrived),
        "used": dict(tag.used),
        "rejected": dict(tag.rejected),
        "lag_s": float(tag.rows.lag_s(tag.row)),
    }


def _innovations(records: Array, anchors: list[str]) -> list[Answer]:
    """Return an `Innovation` for each INNOVATION."""
    return [
        {
            "t_ns": t_ns,
            "kind": _KINDS[kind],
            "anchor": anchors[anchor] if 0 <= anchor < len(anchors) else None,
            "measured": measured,
            "predicted": predicted,
            "innovation": y,
            "variance": S,
            "nis": y * y / S,
            "p_outlier": p_outlier,
            "fused": fused,
        }
        for _, t_ns, kind, anchor, measured, predicted, y, S, p_outlier, fused, *_ in records.tolist()
    ]


def _range_errors(innovations: Array) -> Answer | None:
    """Return the `RangeErrors` that the newest range told."""
    ranges = innovations[innovations["kind"] == MeasurementKind.RANGE]
    if not len(ranges) or not np.isfinite(ranges["white_std"][-1]):
        return None
    return {"white_m": float(ranges["white_std"][-1]), "lasting_m": float(ranges["lasting_std"][-1])}


def _rates(innovations: Array) -> Answer:
    """Return the rates of the last ranges to the anchor of the newest one, measured and predicted."""
    ranges = innovations[innovations["kind"] == MeasurementKind.RANGE]
    if len(ranges):
        newest = ranges[-1]
        ranges = ranges[(ranges["anchor"] == newest["anchor"]) & (ranges["t_ns"] > newest["t_ns"] - RATE_NS)]
    return {
        "range_rate_mps": _slope(ranges["t_ns"], ranges["measured"]),
        "predicted_range_rate_mps": _slope(ranges["t_ns"], ranges["predicted"]),
    }


def _slope(t_ns: Array, values: Array) -> float | None:
    """Return the slope of the least-squares line, per second; None if there are too few values."""
    if len(t_ns) < MIN_RANGES or t_ns[0] == t_ns[-1]:
        return None
    t = (t_ns - t_ns[0]) * 1e-9
    t = t - t.mean()
    return float(t @ values / (t @ t))
