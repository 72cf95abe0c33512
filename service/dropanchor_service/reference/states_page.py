"""The page of tracking states and their reasons, from the enumerations and the hints that people see."""

from dropanchor_schemas.pose import StateReason, TrackingState
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.hints import FEW_RANGES, HINTS, IN_BURSTS, LATE, MOUNT_UNKNOWN, RELATIVE_HINT
from dropanchor_service.reference.markdown import table
from dropanchor_service.store.unknown_anchors import hint_about
from dropanchor_service.store.wrong_times import hint_about_time

_MEANING = {
    TrackingState.INITIALISING: ("The engine has too little to say anything.", "unknown"),
    TrackingState.AMBIGUOUS: ("Several places explain what was measured.", "one of the hypotheses"),
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
_CAUSES = (
    ("no message of the last seconds had samples less than a second old", LATE.format(8)),
    ("three times in a row, silence for more than a second and then the samples of that time", IN_BURSTS.format(3)),
    ("more than 1.5 s between two ranges, on average over 6 s", FEW_RANGES.format(2)),
    ("ranges to anchors that the site does not have, and to no other", hint_about("9", hears_others=False)),
    ("ranges to such an anchor and to others", hint_about("9", hears_others=True)),
    ("`uncertain`, an IMU alone, and no `mount_angle_rad` in the settings", MOUNT_UNKNOWN),
    ("`resolved` in the frame `relative`", RELATIVE_HINT),
    ("times that look like seconds, milliseconds or microseconds", hint_about_time(1_800_000_000_000)),
    ("other times before 2015, without the flag for a clock that counts from boot", hint_about_time(0)),
)


def page() -> str:
    """Return the page as Markdown."""
    states = ((f"`{state}`", *_MEANING[state]) for state in TrackingState)
    hints = dict(zip(REASONS, HINTS, strict=True))
    reasons = ((f"`{reason}`", hints[reason] or "(nothing is needed)") for reason in StateReason)
    return (
        f"{_INTRODUCTION}\n{table(('state', 'meaning', 'position'), states)}\n"
        f"## Reasons\n\n{table(('reason', 'hint'), reasons)}\n"
        f"## Hints about causes\n\n{_CAUSES_INTRODUCTION}\n{table(('cause', 'hint'), _CAUSES)}"
    )
