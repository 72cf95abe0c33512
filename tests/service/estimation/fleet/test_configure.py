"""What an operator tells of a tag, in its row."""

import numpy as np
import pytest

from dropanchor_schemas import StartPose, TagSettings
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.heading_models import COMES_AGAIN, error_of
from dropanchor_service.estimation.fleet.belief.layout import COMMON, STEADY, make_workspace
from dropanchor_service.estimation.fleet.belief.start import choose_model, second_class
from dropanchor_service.estimation.fleet.configure import (
    CRAB_KNOWN_STD,
    CRAB_UNKNOWN_STD,
    MOUNT_KNOWN_STD,
    MOUNT_UNKNOWN_STD,
    V_MAX,
    configured,
)
from dropanchor_service.estimation.fleet.frontend.node import DERIVED_HEADING, NODE
from dropanchor_service.estimation.fleet.tuning import Tuning
from dropanchor_service.settings.engine_columns import tag_columns


def row_of(settings: TagSettings) -> Array:
    row: Array = configured(tag_columns(settings, 0.0), Tuning())
    return row


def test_a_bias_that_is_not_calibrated_has_the_default_spread() -> None:
    assert row_of(TagSettings())["offset_std"] == Tuning().offset_std


@pytest.mark.parametrize("std", [0.0, 0.04])
def test_a_bias_is_known_as_well_as_the_operator_says(std: float) -> None:
    row = row_of(TagSettings(range_bias_m=0.2, range_bias_std_m=std))
    assert [row[name].item() for name in ("offset", "offset_std")] == [0.2, std]


def test_a_known_mounting_angle_leaves_slip_and_an_unknown_one_sway() -> None:
    assert row_of(TagSettings(mount_angle_rad=0.3))["crab_std"] == CRAB_KNOWN_STD
    assert row_of(TagSettings())["crab_std"] == CRAB_UNKNOWN_STD


@pytest.mark.parametrize(("told", "kept"), [(None, Tuning().platform_crab_std), (0.0, 0.0), (0.4, 0.4)])
def test_a_platforms_slip_is_the_default_only_where_it_is_not_told(told: float | None, kept: float) -> None:
    rows = row_of(TagSettings(slip_std_rad=told)).reshape(1)
    node = np.zeros(1, NODE)
    node["heading_kind"] = DERIVED_HEADING
    choose_model(rows[0], node[0], Tuning())
    assert rows[0]["model"] == STEADY
    assert rows[0]["crab_std"] == kept


def test_a_tag_is_no_faster_than_the_operator_says() -> None:
    assert row_of(TagSettings())["v_max"] == V_MAX
    assert row_of(TagSettings(speed_max_mps=1.5))["v_max"] == 1.5


@pytest.mark.parametrize(
    ("angle", "std", "kept"), [(None, None, MOUNT_UNKNOWN_STD), (0.3, None, MOUNT_KNOWN_STD), (0.3, 0.0, 0.0)]
)
def test_a_mounting_angle_is_known_as_well_as_the_operator_says(
    angle: float | None, std: float | None, kept: float
) -> None:
    assert row_of(TagSettings(mount_angle_rad=angle, mount_angle_std_rad=std))["mount_std"] == kept


def test_a_heading_told_not_to_drift_has_one_class_and_no_error_beyond_what_was_told() -> None:
    for told, classes, slow in ((None, 1, 0.03), (0.0, 0, 0.0), (0.01, 0, 0.01)):
        rows = row_of(TagSettings(heading_std_rad=told)).reshape(1)
        rows["model"] = STEADY
        assert second_class(make_workspace()[0]["hypotheses"], 0, 1, rows[0], Tuning(), False) == classes
        assert error_of(rows[0], 1.0)[1] == slow


def test_a_magnetic_heading_is_not_what_was_told_of_the_platforms() -> None:
    rows = row_of(TagSettings(heading_std_rad=0.0)).reshape(1)
    rows["model"] = COMMON
    assert error_of(rows[0], 0.04)[1] == 0.2
    assert second_class(make_workspace()[0]["hypotheses"], 0, 1, rows[0], Tuning(), False) == 1


@pytest.mark.parametrize(("heading", "times"), [(0.5, COMES_AGAIN), (None, 1.0)])
def test_a_magnetometer_counts_for_less_where_the_heading_at_the_start_was_told(
    heading: float | None, times: float
) -> None:
    row = row_of(TagSettings(start=StartPose(x=1.0, y=0.0, heading_rad=heading))).reshape(1)
    row["model"] = COMMON
    assert error_of(row[0], 0.04)[1] == pytest.approx(0.2 * times)
