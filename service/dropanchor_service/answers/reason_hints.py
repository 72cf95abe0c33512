"""What a person can do about each reason of a state."""

from dropanchor_schemas.sentences import say
from dropanchor_service.estimation.columns import StateReason

_MOVE_HINT = say("several_modes", "Walk a few metres, but not straight towards the anchor or away from it.")
_HINTS = {
    StateReason.NO_RANGE: say("no_range", "Too few ranges have arrived: is the anchor on, and is the tag in range?"),
    StateReason.NO_HEADING: say(
        "no_heading",
        "There is no heading yet: the tag must send IMU samples or a platform heading, or range to three anchors.",
    ),
    StateReason.START_UNKNOWN: say(
        "start_unknown", "Set where the tag starts (`start` in its settings), or use the engine fleet."
    ),
    StateReason.SEVERAL_MODES: _MOVE_HINT,
    StateReason.RESOLVED: "",
    StateReason.RANGES_MISSING: say(
        "ranges_missing", "No more ranges arrive: is the anchor on, and is the tag in range?"
    ),
    StateReason.IMU_MISSING: say(
        "imu_missing", "No IMU samples have arrived for a while: check the tag, then walk a few metres."
    ),
    StateReason.RANGES_REJECTED: say(
        "ranges_rejected",
        "The ranges contradict the track: is the line of sight free, and is the anchor where the site says it is?",
    ),
    StateReason.HEADING_DISTURBED: say(
        "heading_disturbed", "Iron or a magnet disturbs the compass: move the tag away from it."
    ),
    StateReason.UNCERTAIN: _MOVE_HINT,
    StateReason.FAULT: say("fault", "The estimate had to start again. If this repeats, check what the tag sends."),
    StateReason.HEADING_UNSURE: say(
        "heading_unsure",
        "There is no heading reference, so north is not known: set where the tag starts and looks, or add a second "
        "anchor.",
    ),
    StateReason.SENSOR_FAULT: say(
        "sensor_fault", "A sensor of this tag failed its check: look at what this tag needs."
    ),
    StateReason.ANCHOR_DOUBTED: say(
        "anchor_doubted", "An anchor seems to stand elsewhere: say where it is, or save it again to confirm its place."
    ),
    StateReason.FRONT_OR_BACK: say(
        "front_or_back",
        "The tag may be behind the anchor instead: turn left and right once, or set `mirrors_behind` of the anchor to "
        "false if none is ever behind.",
    ),
}
HINTS = [_HINTS[reason] for reason in StateReason]
"""By the number of the reason."""
