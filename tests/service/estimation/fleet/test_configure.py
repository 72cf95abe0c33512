"""The settings of an operator in the row of a tag."""

import numpy as np
import pytest

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.births.guesses import may_have_own_error
from dropanchor_service.estimation.fleet.belief.heading_models import (
    REFERENCE_STD,
    SOFT_IRON_FACTOR,
    reference_error,
    reference_std,
)
from dropanchor_service.estimation.fleet.belief.layout import MAGNETOMETER_MODEL, PLATFORM_MODEL
from dropanchor_service.estimation.fleet.belief.start import choose_model
from dropanchor_service.estimation.fleet.configure import (
    MOUNT_UNKNOWN_STD,
    SLIP_KNOWN_STD,
    SLIP_UNKNOWN_STD,
    SPEED_MAX,
    configure_row,
)
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, DERIVED_HEADING, NODE
from dropanchor_service.estimation.fleet.tuning import Tuning
from dropanchor_service.settings.engine_columns import tag_columns


def row_of(settings: TagSettings) -> Array:
    row: Array = configure_row(tag_columns(settings, 0.0), Tuning())
    return row


def may_start_with_own_error(row: Array) -> bool:
    """Whether a tag that starts where the operator said gets a second class of heading errors."""
    row["start"]["known"], node = 1, np.zeros(1, NODE)
    node["heading_kind"] = DERIVED_HEADING
    return bool(may_have_own_error(row, node[0], Tuning().record()[0]))


def test_a_bias_that_is_not_calibrated_has_the_default_spread() -> None:
    assert row_of(TagSettings())["settings"]["range_bias_std"] == Tuning().range_bias_std


@pytest.mark.parametrize("std", [0.0, 0.04])
def test_a_bias_is_as_certain_as_the_operators_setting(std: float) -> None:
    row = row_of(TagSettings(range_bias_m=0.2, range_bias_std_m=std))
    assert [row["settings"][name].item() for name in ("range_bias", "range_bias_std")] == [0.2, std]


def test_a_known_mounting_angle_leaves_slip_and_an_unknown_one_sway() -> None:
    assert row_of(TagSettings(mount_angle_rad=0.3))["settings"]["slip_std"] == SLIP_KNOWN_STD
    assert row_of(TagSettings())["settings"]["slip_std"] == SLIP_UNKNOWN_STD


@pytest.mark.parametrize(("given", "kept"), [(None, Tuning().platform_slip_std), (0.0, 0.0), (0.4, 0.4)])
def test_a_platforms_slip_is_the_default_only_where_it_is_not_set(given: float | None, kept: float) -> None:
    rows = row_of(TagSettings(slip_std_rad=given)).reshape(1)
    node = np.zeros(1, NODE)
    node["heading_kind"] = DERIVED_HEADING
    choose_model(rows[0], node[0], Tuning())
    assert rows[0]["heading"]["model"] == PLATFORM_MODEL
    assert rows[0]["settings"]["slip_std"] == kept


def test_a_tag_is_no_faster_than_the_operators_limit() -> None:
    assert row_of(TagSettings())["settings"]["speed_max"] == SPEED_MAX
    assert row_of(TagSettings(speed_max_mps=1.5))["settings"]["speed_max"] == 1.5


@pytest.mark.parametrize(
    ("angle", "std", "kept"), [(None, None, MOUNT_UNKNOWN_STD), (0.3, None, Tuning().mount_known_std), (0.3, 0.0, 0.0)]
)
def test_a_mounting_angle_is_as_certain_as_the_operators_setting(
    angle: float | None, std: float | None, kept: float
) -> None:
    assert row_of(TagSettings(mount_angle_rad=angle, mount_angle_std_rad=std))["settings"]["mount_angle_std"] == kept


def test_a_heading_set_not_to_drift_has_one_class_and_no_error_beyond_the_setting() -> None:
    for given, other_class, slow in ((None, True, 0.03), (0.0, False, 0.0), (0.01, False, 0.01)):
        rows = row_of(TagSettings(heading_std_rad=given)).reshape(1)
        rows["heading"]["model"] = PLATFORM_MODEL
        assert may_start_with_own_error(rows[0]) == other_class
        assert reference_error(rows[0], 1.0)[1] == slow


def test_the_setting_for_a_platforms_heading_does_not_change_a_magnetic_one() -> None:
    rows = row_of(TagSettings(heading_std_rad=0.0)).reshape(1)
    rows["heading"]["model"] = MAGNETOMETER_MODEL
    assert reference_error(rows[0], 0.04)[1] == 0.2
    assert may_start_with_own_error(rows[0])


@pytest.mark.parametrize(("given", "slow"), [(None, 0.6), (0.0, 0.2), (0.15, 0.25)])
def test_with_the_imu_as_the_source_the_setting_is_the_error_of_north(given: float | None, slow: float) -> None:
    start = StartPose(x=1.0, y=0.0, heading_rad=0.5)
    rows = row_of(TagSettings(heading_source="imu", heading_std_rad=given, start=start)).reshape(1)
    node = np.zeros(1, NODE)
    node["heading"], node["heading_kind"] = 0.7, ABSOLUTE_HEADING
    choose_model(rows[0], node[0], Tuning())
    assert reference_error(rows[0], 0.04)[1] == pytest.approx(slow)
    assert may_start_with_own_error(rows[0]) == (given is None)
    assert rows["heading"]["north"][0] == pytest.approx(0.2 if given is None else 0.0)
    assert reference_std(rows[0]) == (REFERENCE_STD if given is None else given)


@pytest.mark.parametrize(
    ("kind", "told", "std"),
    [
        (ABSOLUTE_HEADING, None, REFERENCE_STD),
        (ABSOLUTE_HEADING, 0.24, 0.26),
        (DERIVED_HEADING, 0.24, REFERENCE_STD),
    ],
)
def test_the_error_of_the_sites_declination_is_one_of_magnetic_headings(
    kind: int, told: float | None, std: float
) -> None:
    row = configure_row(tag_columns(TagSettings(), 0.5, told), Tuning()).reshape(1)
    node = np.zeros(1, NODE)
    node["heading_kind"] = kind
    choose_model(row[0], node[0], Tuning())
    assert reference_std(row[0]) == pytest.approx(std)


def test_a_magnetometer_needs_the_declination_also_after_a_platform_has_told_the_heading() -> None:
    row = configure_row(tag_columns(TagSettings(), 0.5, 0.24), Tuning()).reshape(1)
    for kind in (DERIVED_HEADING, ABSOLUTE_HEADING):
        node = np.zeros(1, NODE)
        node["heading_kind"] = kind
        choose_model(row[0], node[0], Tuning())
    assert reference_std(row[0]) == pytest.approx(0.26)


@pytest.mark.parametrize(("heading", "times"), [(0.5, SOFT_IRON_FACTOR), (None, 1.0)])
def test_a_magnetometer_counts_for_less_where_the_heading_at_the_start_was_set(
    heading: float | None, times: float
) -> None:
    row = row_of(TagSettings(start=StartPose(x=1.0, y=0.0, heading_rad=heading))).reshape(1)
    row["heading"]["model"] = MAGNETOMETER_MODEL
    assert reference_error(row[0], 0.04)[1] == pytest.approx(0.2 * times)
