"""What most of a tag's uncertainty comes from, as a sentence with its cure."""

from typing import Any

import pytest

from dropanchor_schemas.explain import Uncertainty
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.answers.uncertainty import uncertainty_of

PARTS = {"north_m": 0.1, "mount_m": 0.1, "speed_m": 0.1, "bearing_m": 0.1, "ranges_m": 0.1, "height_m": 0.1}
STARTED = StartPose(x=1.0, y=2.0)


def pose_with(**parts: float) -> dict[str, Any]:
    ellipse = {"semi_major_m": 8.9, "semi_minor_m": 1.0, "angle_rad": 0.0}
    return {"relative_pose": None, "sigma_parts": PARTS | parts, "ellipse_95": ellipse, "sigma_pos_m": 4.0}


@pytest.mark.parametrize(
    ("cause", "settings", "cure"),
    [
        ("north", TagSettings(), "`start`"),
        ("north", TagSettings(start=STARTED), "`heading_std_rad`"),
        ("north", TagSettings(start=STARTED, heading_std_rad=0.1), "second anchor"),
        ("bearing", TagSettings(), "`start`"),
        ("bearing", TagSettings(start=STARTED), "second anchor"),
        ("mount", TagSettings(), "`mount_angle_rad`"),
        ("mount", TagSettings(mount_angle_rad=0.0), "`slip_std_rad`"),
        ("mount", TagSettings(mount_angle_rad=0.0, slip_std_rad=0.0), "second anchor"),
        ("mount", TagSettings(motion="carried"), "second anchor"),
        ("speed", TagSettings(), "stop"),
        ("ranges", TagSettings(), "`range_bias_std_m`"),
        ("height", TagSettings(), "`height_m`"),
    ],
)
def test_the_largest_part_is_named_with_something_that_the_settings_do_not_tell_yet(
    cause: str, settings: TagSettings, cure: str
) -> None:
    answer = Uncertainty.model_validate(uncertainty_of(pose_with(**{f"{cause}_m": 3.6}), settings))
    assert answer.largest == cause
    assert answer.largest_m == pytest.approx(8.9 * 3.6 / 4.0)
    assert answer.text.startswith("± 8.9 m, of which 8.0 m come from ")
    assert cure in answer.text
    assert answer.phrase.values["cause.code"] == f"uncertain.{cause}"


@pytest.mark.parametrize(("cause", "named"), [("north", True), ("bearing", True), ("speed", False)])
def test_what_other_tags_know_about_north_comes_before_what_a_person_could_tell(cause: str, named: bool) -> None:
    offer = say("site_north", "{tags} tags know north. Apply that to all.", tags=2)
    answer = Uncertainty.model_validate(uncertainty_of(pose_with(**{f"{cause}_m": 3.6}), TagSettings(), offer))
    assert ("Apply that to all." in answer.text) == named
    assert (answer.phrase.values["cure.code"] == "site_north") == named


def test_an_engine_that_tells_no_parts_has_no_uncertainty_to_explain() -> None:
    assert uncertainty_of(pose_with() | {"sigma_parts": None}, TagSettings()) is None
    assert uncertainty_of(pose_with() | {"ellipse_95": None}, TagSettings()) is None


def test_in_a_frame_of_its_own_the_ellipse_is_that_of_the_frame() -> None:
    pose = pose_with(north_m=3.6)
    own = {"ellipse_95": pose["ellipse_95"], "sigma_pos_m": 4.0}
    found = uncertainty_of(pose | {"relative_pose": own, "ellipse_95": None, "sigma_pos_m": None}, TagSettings())
    assert found is not None
    assert found["half_m"] == 8.9
