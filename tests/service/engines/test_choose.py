"""Settings become columns of an engine, and the chosen engine is created."""

import math
from typing import Any

import pytest

from dropanchor_schemas.site import Anchor, StartPose, TagSettings
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.estimation.columns import HeadingSource, Motion
from dropanchor_service.settings.engine_columns import anchor_columns, tag_columns
from dropanchor_service.settings.sources import load_settings


def test_settings_of_a_tag_become_columns_and_settings_not_given_become_nan() -> None:
    start = StartPose(x=1.0, y=2.0)
    columns = tag_columns(TagSettings(height_m=1.5, heading_source="platform", start=start), declination_rad=0.1)
    assert columns["height"] == 1.5
    assert columns["heading_source"] == HeadingSource.PLATFORM
    assert columns["declination"] == 0.1
    assert [columns[name].item() for name in ("start_known", "start_x", "start_y")] == [True, 1.0, 2.0]
    optional = ("range_std", "range_bias_std", "mount_angle", "mount_angle_std", "slip_std", "heading_std", "speed_max")
    assert all(math.isnan(columns[name]) for name in optional)
    assert math.isnan(columns["start_heading"])


def test_a_lever_arm_points_forward_and_to_the_left() -> None:
    columns = tag_columns(TagSettings(lever_forward_m=0.6, lever_left_m=-0.2), 0.0)
    assert [columns[name].item() for name in ("lever_x", "lever_y")] == [0.6, -0.2]


@pytest.mark.parametrize("motion", list(Motion))
def test_what_moves_a_tag_becomes_a_column(motion: Motion) -> None:
    assert tag_columns(TagSettings(), 0.0)["motion"] == Motion.AUTO
    name: Any = motion.name.lower()
    assert tag_columns(TagSettings(motion=name), 0.0)["motion"] == motion


def test_a_setting_of_zero_is_zero_and_not_nan() -> None:
    settings = TagSettings(range_bias_std_m=0.0, mount_angle_std_rad=0.0, slip_std_rad=0.0, heading_std_rad=0.0)
    columns = tag_columns(settings, 0.0)
    optional = ("range_bias_std", "mount_angle_std", "slip_std", "heading_std")
    assert [columns[name].item() for name in optional] == [0.0] * 4


def test_a_tag_without_a_start_does_not_start_at_the_origin() -> None:
    columns = tag_columns(TagSettings(), 0.0)
    assert not columns["start_known"]
    assert math.isnan(columns["start_x"])


def test_anchors_keep_their_order() -> None:
    places = anchor_columns([Anchor(id="1", x=1.0), Anchor(id="2", z=3.0)])
    assert places[["x", "y", "z"]].tolist() == [(1.0, 0.0, 0.0), (0.0, 0.0, 3.0)]
    assert len(anchor_columns([])) == 0


@pytest.mark.parametrize("name", ["paper", "fleet"])
def test_the_chosen_engine_is_created(name: str) -> None:
    assert create_engine(load_settings(environment={"DROPANCHOR_ENGINE": name})).name == name
