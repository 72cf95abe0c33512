"""The page of tracking states and their reasons, from the enumerations and the hints that people see."""

from dropanchor_schemas.pose import StateReason, TrackingState
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.hints import HINTS
from dropanchor_service.reference.markdown import table

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


def page() -> str:
    """Return the page as Markdown."""
    states = ((f"`{state}`", *_MEANING[state]) for state in TrackingState)
    hints = dict(zip(REASONS, HINTS, strict=True))
    reasons = ((f"`{reason}`", hints[reason] or "(nothing is needed)") for reason in StateReason)
    return (
        f"{_INTRODUCTION}\n{table(('state', 'meaning', 'position'), states)}\n"
        f"## Reasons\n\n{table(('reason', 'hint'), reasons)}"
    )
