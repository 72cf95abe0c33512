"""The replay of a recording compares places that are in the same frame, and no others."""

from typing import Any

import numpy as np

from dropanchor_service.commands.replay_mcap import Outcome
from dropanchor_service.estimation.columns import POSE, Frame
from dropanchor_service.recording.reading import Turn

AT_HOME: dict[str, Any] = {"x": 3.0, "y": 4.0}
IN_SITE = {"frame": "site", **AT_HOME}
RELATIVE = {"frame": "relative", "relative_pose": AT_HOME}
UNKNOWN = {"frame": "relative"}


def outcome(recorded: dict[str, Any], frame: Frame, x: float = 0.0, y: float = 0.0) -> str:
    """Return what a replay says that has this place where the recording has that one."""
    poses = np.zeros(1, POSE)
    poses["frame"], poses["x"], poses["y"] = frame, x, y
    compared = Outcome()
    compared.add(Turn(0, estimates=[("cart", {"t_ns": 0, **recorded})]), ["cart"], poses)
    return "\n".join(compared.lines())


def test_places_in_the_same_frame_are_compared() -> None:
    different, same = outcome(IN_SITE, Frame.SITE), outcome(RELATIVE, Frame.RELATIVE, 3.0, 4.0)
    assert "1 compared, 0 equal within a nanometre, worst difference 5 m" in different
    assert "normal for tags that were already running when the recording started" in different
    assert "1 compared, 1 equal within a nanometre, worst difference 0 m" in same
    assert "normal" not in same


def test_a_place_in_the_site_is_not_compared_with_one_in_a_frame_of_the_tags_own() -> None:
    for said in (outcome(IN_SITE, Frame.RELATIVE), outcome(RELATIVE, Frame.SITE)):
        assert "worst difference" not in said
        assert "1 not compared, because only the recording or only the replay has a position, or knows north" in said


def test_no_place_equals_no_place_and_nothing_else() -> None:
    assert "1 compared, 1 equal" in outcome(UNKNOWN, Frame.SITE, np.nan, np.nan)
    assert "1 not compared" in outcome(UNKNOWN, Frame.RELATIVE)
