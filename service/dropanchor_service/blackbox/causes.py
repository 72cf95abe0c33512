"""What made the poses of a tag wrong though nobody changed a setting."""

import math
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

from dropanchor_schemas.sentences import Sentence, phrase_of, say
from dropanchor_service.answers.doubted_anchors import sentence_of
from dropanchor_service.blackbox.mounting import Turned, turned
from dropanchor_service.blackbox.rerun import Rerun

JUST_BEFORE_NS = 1_500_000_000


def causes_of(run: Rerun) -> list[dict[str, Any]]:
    """Return each `Cause` that a run has shown so far."""
    return [*_of_anchor(run), *_of_mounting(run)]


def _of_anchor(run: Rerun) -> Iterator[dict[str, Any]]:
    if (doubt := run.doubt) is not None:
        yield _cause(sentence_of(doubt), doubt.since_ns or run.begin_ns) | {"anchor": doubt.anchor}


def _of_mounting(run: Rerun) -> Iterator[dict[str, Any]]:
    if run.settings.motion != "carried":
        imu, told = run.imu(), run.settings.mount_angle_rad
        if (turn := turned(imu["arrival_ns"], imu["acc"], imu["gyro"], told)) is not None:
            yield _cause(_of_turn(turn), turn.t_ns - JUST_BEFORE_NS) | {"mount_angle_rad": round(turn.after, 2)}


def _cause(text: Sentence, from_ns: int) -> dict[str, Any]:
    return {"text": text, "phrase": phrase_of(text), "from_ns": from_ns}


def _of_turn(turn: Turned) -> Sentence:
    before, after = (f"{math.degrees(angle):.0f}" for angle in (turn.before, turn.after))
    return say(
        "tag_turned",
        "The tag was turned on what carries it at {time} UTC: its bends show a mounting angle of {before}° before, and "
        "of {after}° since.",
        time=datetime.fromtimestamp(turn.t_ns // 10**9, UTC).strftime("%H:%M:%S"),
        before=before,
        after=after,
    )
