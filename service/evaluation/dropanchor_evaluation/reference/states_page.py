"""The page of tracking states and their reasons, from the enumerations and the hints that people see."""

from dropanchor_evaluation.reference.markdown import table
from dropanchor_schemas.pose import StateReason, TrackingState
from dropanchor_schemas.rejections import Reason
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.doubted_anchors import anchor_misplaced, anchor_moved
from dropanchor_service.answers.hints import (
    FORWARD_IMU,
    FORWARD_RANGES,
    FORWARD_UNKNOWN,
    MOTION_COMES,
    MOUNT_UNKNOWN,
    RANGES_COME,
    RELATIVE_HINT,
    all_zero,
    few_ranges,
    in_bursts,
    lags,
    late,
    needs_both,
)
from dropanchor_service.answers.reason_hints import HINTS
from dropanchor_service.answers.unused import WHY, behind, not_used
from dropanchor_service.estimation.plausibility.verdicts import SENTENCES
from dropanchor_service.store.rows import MESSAGE
from dropanchor_service.store.unknown_anchors import hint_about
from dropanchor_service.store.wrong_times import hint_about_time

_MEANING = {
    TrackingState.INITIALISING: ("The engine has too little to say anything.", "unknown"),
    TrackingState.AMBIGUOUS: ("Several places explain what was measured.", "one of the hypotheses"),
    TrackingState.RELATIVE: (
        "North is not known: the place is known in a frame of the tag's own only.",
        "none in the site; `relative_pose` has it up to a turn about the anchor",
    ),
    TrackingState.TRACKING: ("One place is left and its ellipse is small.", "believe it within its ellipse"),
    TrackingState.COASTING: ("No range has come for a while.", "predicted only"),
    TrackingState.DEGRADED: ("Something contradicts the track.", "believe the ellipse, not the dot"),
    TrackingState.LOST: ("The pose is too old or the estimate broke.", "do not use it"),
}
_INTRODUCTION = """\
# States of a pose

Every pose carries a state, a reason for machines and a hint for people. Whoever draws a pose should look at them.
[How to read states](../how-to/read-states.md) explains them with examples.
"""

_CAUSES_INTRODUCTION = """\
Some causes show only in what the tag sends, and not in its state. A hint about one of them replaces that of the reason.
"""

_SENSORS_INTRODUCTION = """\
The service checks the sensors of every tag by what it sends
([how](../how-to/look-after-tags.md#sensors-that-fail-their-check)).
A tag that fails has no position and the reason `sensor_fault`. With `upside_down`, `…_doubted` and `range_averaged` the
samples are used, but the tag is `degraded` instead of `tracking`.
"""


_CAUSES = (
    (
        "most of the last 5 to 10 s of a kind were not used: `late`, behind the IMU",
        not_used(399, 401, "range", behind(3.1)),
    ),
    ("`time_repeated`", not_used(990, 1000, "imu", str(WHY["imu"][Reason.TIME_REPEATED]))),
    ("`imu_stuck`", not_used(950, 1000, "imu", str(WHY["imu"][Reason.IMU_STUCK]))),
    ("`range_stuck`", not_used(98, 98, "range", str(WHY["range"][Reason.RANGE_STUCK]))),
    (
        "any other [reason](rejections.md), such as `json_schema`",
        not_used(12, 12, MESSAGE, str(WHY[MESSAGE][Reason.JSON_SCHEMA])),
    ),
    ("five or more ranges of 0, and none other since", all_zero(218)),
    ("no position yet", needs_both(5, 120)),
    ("`ranges_missing` or `no_range` although ranges arrive", RANGES_COME),
    ("`imu_missing` although motion arrives", MOTION_COMES),
    ("nothing is needed, and the IMU samples come in batches", lags(1.2)),
    ("no message of the last seconds had samples less than a second old", late(8)),
    ("three times in a row, silence for more than a second and then the samples of that time", in_bursts(3)),
    ("more than 1.5 s between two ranges, on average over 6 s", few_ranges(2)),
    ("ranges to anchors that the site does not have, and to no other", hint_about("9", hears_others=False)),
    ("ranges to such an anchor and to others", hint_about("9", hears_others=True)),
    (
        f"`several_modes` after {FORWARD_RANGES} ranges and {FORWARD_IMU} IMU samples, and no `mount_angle_rad`",
        FORWARD_UNKNOWN,
    ),
    ("`uncertain`, an IMU alone, and no `mount_angle_rad` in the settings", MOUNT_UNKNOWN),
    ("`resolved` in the state `relative`", RELATIVE_HINT),
    ("`anchor_doubted`", anchor_moved("7", 2.9, 1_790_000_000_000_000_000)),
    ("`anchor_doubted`", anchor_misplaced("7", 2.9)),
    ("times that look like seconds, milliseconds or microseconds", hint_about_time(1_800_000_000_000)),
    ("other times before 2015, without the flag for a clock that counts from boot", hint_about_time(0)),
)


def page() -> str:
    """Return the page as Markdown."""
    states = ((f"`{state}`", *_MEANING[state]) for state in TrackingState)
    hints = dict(zip(REASONS, HINTS, strict=True))
    reasons = ((f"`{reason}`", hints[reason] or "(nothing is needed)") for reason in StateReason)
    found = ((f"`{name}`", sentence.format(number="…")) for name, sentence in SENTENCES.items())
    return (
        f"{_INTRODUCTION}\n{table(('state', 'meaning', 'position'), states)}\n"
        f"## Reasons\n\n{table(('reason', 'hint'), reasons)}\n"
        f"## Hints about causes\n\n{_CAUSES_INTRODUCTION}\n{table(('cause', 'hint'), _CAUSES)}\n"
        f"## Sensors that fail their check\n\n{_SENSORS_INTRODUCTION}\n{table(('found', 'hint'), found)}"
    )
