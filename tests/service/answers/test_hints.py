"""The hints that people get about a state, and about how samples arrive."""

from collections.abc import Sequence

import numpy as np
import pytest

from dropanchor_schemas.pose import Pose
from dropanchor_schemas.pose import StateReason as ReasonName
from dropanchor_schemas.site import Anchor, TagSettings
from dropanchor_schemas.wire import Frame, HeadingSample, ImuSample, RangeSample
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.reason_hints import HINTS
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, State, StateReason
from support.ingest import IngestBench

S = 1_000_000_000
T = 1_760_000_000 * S


def test_the_contract_has_exactly_the_reasons_of_the_engines() -> None:
    assert [reason.value for reason in ReasonName] == REASONS
    schema = Pose.model_json_schema()
    assert schema["$defs"]["StateReason"]["enum"] == REASONS


@pytest.mark.parametrize("reason", [reason for reason in StateReason if reason is not StateReason.RESOLVED])
def test_the_hint_of_every_problem_is_a_sentence_that_says_what_to_do(reason: StateReason) -> None:
    hint = HINTS[reason]
    assert hint[0].isupper()
    assert hint[-1] in ".?"
    assert len(hint) < 140


def test_a_good_pose_has_no_hint() -> None:
    assert HINTS[StateReason.RESOLVED] == ""


class Listener:
    """A tag that sends to an ingest, and the hint that people get about it."""

    def __init__(self) -> None:
        self.bench = IngestBench(site={"anchors": [{"id": "7"}]})
        self.now_ns = T
        bench = self.bench
        self.answers = Answers(bench.site, bench.tags, bench.latest, now_ns=lambda: self.now_ns)

    def send(self, arrival_s: float, times_s: Sequence[float], anchor: int = 7, ranges: bool = True) -> None:
        """Send a message that arrives at one time, with IMU samples, and perhaps ranges, of other times."""
        times = [T + round(t * S) for t in times_s]
        imu = [ImuSample(t, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0)) for t in times]
        measured = [RangeSample(t, anchor, 5.0) for t in times if ranges]
        self.now_ns = T + round(arrival_s * S)
        self.bench.put("cart", Frame(imu=imu, ranges=measured), at_ns=self.now_ns)
        self.bench.ingest.turn()

    def hint(self, reason: StateReason = StateReason.RESOLVED, later_s: float = 0.0) -> str:
        """Return the hint about a pose with this reason, some time after the last message."""
        self.now_ns += round(later_s * S)
        poses = np.zeros(1, POSE)
        poses["t_ns"], poses["state"], poses["reason"] = self.now_ns, State.TRACKING, reason
        self.bench.latest.write(poses, np.empty(0, HYPOTHESIS))
        tag = self.bench.tags.find("cart")
        assert tag is not None
        pose = self.answers.pose_of(tag)
        assert pose is not None
        frame = self.answers.frame_of(self.answers.rows(), self.now_ns)
        assert list(frame["hint"]) == [pose["hint"]]
        return str(pose["hint"])


def test_samples_that_come_steadily_and_in_time_give_no_hint() -> None:
    cart = Listener()
    for i in range(100):
        cart.send(0.1 * i + 0.05, [0.1 * i])
    assert cart.hint() == ""


def test_samples_that_come_late_are_said_to_be_late() -> None:
    cart = Listener()
    for i in range(200):
        cart.send(0.1 * i + 8.0, [0.1 * i])
    for reason in (StateReason.RANGES_MISSING, StateReason.NO_RANGE):
        assert cart.hint(reason).startswith("Samples arrive 8 s late")
    assert cart.hint(StateReason.RANGES_REJECTED) == HINTS[StateReason.RANGES_REJECTED]


def test_one_late_message_among_others_is_not_called_late() -> None:
    cart = Listener()
    for i in range(100):
        cart.send(0.1 * i + 0.05, [0.1 * i])
    cart.send(10.1, [8.4])
    assert cart.hint() == ""


def test_single_samples_far_apart_are_few_and_no_bursts() -> None:
    cart = Listener()
    for i in range(10):
        cart.send(3.0 * i + 0.05, [3.0 * i])
    assert cart.hint(StateReason.RANGES_MISSING).startswith("One range in 3 s is too few")


def test_samples_that_come_in_bursts_are_said_to_come_in_bursts() -> None:
    cart = Listener()
    for burst in range(6):
        first_s = 3.0 * burst
        for part in range(3):  # three messages at once
            cart.send(first_s + 3.0 + 0.01 * part, [first_s + part + 0.1 * i for i in range(10)])
    for later_s in (0.0, 2.5):
        assert cart.hint(StateReason.RANGES_MISSING, later_s).startswith("Samples come in bursts of 3 s")
    assert cart.hint(StateReason.RANGES_MISSING, 20.0) == HINTS[StateReason.RANGES_MISSING]


def test_one_outage_is_no_burst() -> None:
    cart = Listener()
    for i in range(50):
        cart.send(0.1 * i, [0.1 * i])
    for i in range(50):
        cart.send(8.0 + 0.1 * i, [8.0 + 0.1 * i])
    assert cart.hint() == ""


def test_too_few_ranges_are_said_to_be_too_few() -> None:
    cart = Listener()
    for i in range(200):
        cart.send(0.1 * i + 0.05, [0.1 * i], ranges=i % 20 == 0)
    for reason in (StateReason.RESOLVED, StateReason.UNCERTAIN, StateReason.RANGES_MISSING):
        assert cart.hint(reason).startswith("One range in 2 s is too few")


def test_a_tag_that_no_longer_sends_gets_the_hint_of_its_state() -> None:
    cart = Listener()
    for i in range(200):
        cart.send(0.1 * i + 8.0, [0.1 * i])
    assert cart.hint(StateReason.RANGES_MISSING, later_s=3.0) == HINTS[StateReason.RANGES_MISSING]


def test_a_tag_that_hears_no_anchor_of_the_site_is_told_from_one_that_hears_some() -> None:
    cart = Listener()
    cart.send(0.1, [0.0], anchor=9)
    assert cart.hint(StateReason.NO_RANGE).startswith("No anchor that it hears is part of this site")
    assert "anchor 9" in cart.hint(StateReason.NO_RANGE)
    cart.send(0.2, [0.1], anchor=7)
    cart.send(0.3, [0.2], anchor=9)
    assert cart.hint(StateReason.RANGES_MISSING).startswith("Hears anchor 9, which this site does not have")
    cart.bench.site.set_anchor(Anchor(id="9"))
    assert "anchor 9" not in cart.hint(StateReason.RANGES_MISSING)


def test_the_mounting_angle_is_named_only_where_it_is_unknown() -> None:
    cart = Listener()
    cart.send(0.1, [0.0])
    assert cart.hint(StateReason.UNCERTAIN).startswith("The mounting angle is not known yet: turn left and right once")
    assert cart.hint(StateReason.SEVERAL_MODES) == HINTS[StateReason.SEVERAL_MODES]
    for known in (TagSettings(mount_angle_rad=0.0), TagSettings(motion="carried")):
        cart.bench.site.set_tag("cart", known)
        assert cart.hint(StateReason.UNCERTAIN) == HINTS[StateReason.UNCERTAIN]


def test_a_tag_that_may_go_backwards_for_long_is_told_what_shows_its_front() -> None:
    cart = Listener()
    for i in range(300):
        cart.send(0.1 * i + 0.1, [0.1 * i + 0.01 * k for k in range(10)])
    assert cart.hint(StateReason.SEVERAL_MODES).startswith("Forwards cannot be told from backwards yet: brake")
    cart.bench.site.set_tag("cart", TagSettings(mount_angle_rad=0.0))
    assert cart.hint(StateReason.SEVERAL_MODES) == HINTS[StateReason.SEVERAL_MODES]


def test_a_tag_with_a_heading_of_its_platform_has_no_mounting_angle_to_learn() -> None:
    cart = Listener()
    cart.send(0.1, [0.0])
    cart.bench.put("cart", Frame(headings=[HeadingSample(T + S // 5, 1.0)]), at_ns=T + S // 5)
    cart.bench.ingest.turn()
    assert cart.hint(StateReason.UNCERTAIN) == HINTS[StateReason.UNCERTAIN]


def test_a_missing_heading_reference_is_named() -> None:
    assert HINTS[StateReason.HEADING_UNSURE].startswith("There is no heading reference")
