"""A tag needs care for reasons that a person can do something about, and the answer says what."""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.answers.care import NO_CONTACT_S, SPOOL_RISES, care_of
from dropanchor_service.store import HealthTable, Tag, TagTable
from dropanchor_service.store.clock_offsets import ClockOffset, MotionOffset

S = 1_000_000_000
NOW_NS = 1_800_000_000 * S


class Fleet:
    """Tags that report health and send samples."""

    def __init__(self) -> None:
        self.tags = TagTable()
        self.health = HealthTable()

    def report(self, name: str, **values: Any) -> None:
        self.health.record(self.tags.register(name).row, values, NOW_NS)

    def tag(self, name: str) -> Tag:
        return self.tags.register(name)

    def care(self, name: str, after_s: float = 0.0) -> dict[str, str]:
        found = care_of(self.tag(name), self.health, NOW_NS + round(after_s * S))
        return {care["reason"]: care["hint"] for care in found}


def test_a_tag_that_has_reported_nothing_or_only_good_values_needs_no_care() -> None:
    fleet = Fleet()
    assert fleet.care("silent") == {}
    fleet.report("a", battery_fraction=0.2, firmware="1", spool_bytes=0)
    assert fleet.care("a") == {}


def test_a_low_battery_needs_care() -> None:
    fleet = Fleet()
    fleet.report("a", battery_fraction=0.19)
    assert fleet.care("a") == {"battery_low": "The battery is at 19%: charge it."}


def test_firmware_needs_care_while_it_differs_from_that_of_more_than_half_of_the_fleet() -> None:
    fleet = Fleet()
    fleet.report("a", firmware="1.0")
    fleet.report("b", firmware="1.1")
    assert fleet.care("a") == fleet.care("b") == {}
    fleet.report("c", firmware="1.1")
    assert set(fleet.care("a")) == {"firmware_differs"}
    assert "1.0" in fleet.care("a")["firmware_differs"]
    assert fleet.care("b") == {}
    fleet.report("a", firmware="1.1")
    assert fleet.care("a") == {}


@pytest.mark.parametrize(("offset_s", "said"), [(0.8, "0.8 s ahead"), (-1.2, "1.2 s behind")])
def test_clocks_that_are_far_apart_need_care(offset_s: float, said: str) -> None:
    fleet = Fleet()
    tag = fleet.tag("a")
    assert care_of(tag, fleet.health, NOW_NS, ClockOffset(0.25, 0.1)) == []
    [care] = care_of(tag, fleet.health, NOW_NS, ClockOffset(offset_s, 0.1))
    assert care["reason"] == "clock_offset"
    assert said in care["hint"]


@pytest.mark.parametrize(("by_messages_s", "by_motion_s", "late"), [(0.8, 0.0, "ranges"), (0.0, 0.8, "motion")])
def test_a_contradiction_of_message_times_and_motion_needs_care_and_names_the_side_that_is_late(
    by_messages_s: float, by_motion_s: float, late: str
) -> None:
    fleet = Fleet()
    offset = ClockOffset(by_messages_s, 0.1, MotionOffset(by_motion_s, 0.25))
    [care] = care_of(fleet.tag("a"), fleet.health, NOW_NS, offset)
    assert care["reason"] == "clock_offset"
    assert f"the messages with the {late} probably come 0.8 s late" in care["hint"]


def test_a_spool_needs_care_when_it_grows_from_report_to_report() -> None:
    fleet = Fleet()
    for i in range(SPOOL_RISES):
        assert fleet.care("a") == {}
        fleet.report("a", spool_bytes=1_000_000 * (i + 1))
        fleet.report("a", temperature_c=20.0)
    assert "3.0 MB" in fleet.care("a")["spool_growing"]
    fleet.report("a", spool_bytes=2_000_000)
    assert fleet.care("a") == {}


def test_a_tag_without_contact_needs_care_and_the_hint_says_whether_it_is_connected() -> None:
    fleet = Fleet()
    fleet.tags.rows.count_messages(np.array([fleet.tag("a").row]), NOW_NS)
    assert fleet.care("a", NO_CONTACT_S - 1.0) == {}
    assert "check its power" in fleet.care("a", NO_CONTACT_S + 1.0)["no_contact"]
    fleet.tags.presence.set_token("a", True)
    assert "check its sensors" in fleet.care("a", NO_CONTACT_S + 1.0)["no_contact"]


def test_a_tag_that_has_only_reported_health_is_without_contact_once_that_ends() -> None:
    fleet = Fleet()
    fleet.report("a", battery_fraction=0.5)
    assert fleet.care("a", NO_CONTACT_S - 1.0) == {}
    assert set(fleet.care("a", NO_CONTACT_S + 1.0)) == {"no_contact"}
