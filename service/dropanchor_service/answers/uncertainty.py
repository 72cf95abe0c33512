"""What most of a tag's uncertainty comes from, and what would take it away."""

from typing import Any

from dropanchor_schemas.explain import UncertaintyCause as Cause
from dropanchor_schemas.sentences import Sentence, phrase_of, say
from dropanchor_schemas.site import TagSettings

Answer = dict[str, Any]


def uncertainty_of(pose: Answer, settings: TagSettings, by_others: str = "") -> Answer | None:
    """Return the `Uncertainty` of a `Pose` in JSON, None where its engine does not tell the parts.

    by_others: what other tags know about north, with what to do; empty: nothing.
    """
    placed = pose["relative_pose"] or pose
    parts, ellipse, sigma = pose["sigma_parts"], placed["ellipse_95"], placed["sigma_pos_m"]
    if parts is None or ellipse is None or not sigma > 0.0:
        return None
    largest = max(Cause, key=lambda cause: parts[f"{cause}_m"])
    half = ellipse["semi_major_m"]
    part = half * parts[f"{largest}_m"] / sigma
    of_north = largest in (Cause.NORTH, Cause.BEARING)
    text = _sentence(half, part, largest, (of_north and by_others) or _cure(largest, settings))
    return {"half_m": half, "largest": largest, "largest_m": part, "text": text, "phrase": phrase_of(text)}


def _sentence(half: float, part: float, largest: Cause, cure: str) -> Sentence:
    return say(
        "uncertainty",
        "± {half} m, of which {part} m come from {cause}. {cure}",
        half=f"{half:.1f}",
        part=f"{part:.1f}",
        cause=_CAUSES[largest],
        cure=cure,
    )


_CAUSES = {
    Cause.NORTH: say("uncertain.north", "where north is"),
    Cause.MOUNT: say("uncertain.mount", "how the tag is mounted or held"),
    Cause.SPEED: say("uncertain.speed", "its speed"),
    Cause.BEARING: say("uncertain.bearing", "the direction in which it started"),
    Cause.RANGES: say("uncertain.ranges", "its ranges"),
    Cause.HEIGHT: say("uncertain.height", "its height"),
}
_TELL_START = say("cure.start", "Set where it starts and looks (`start`).")
_SECOND_ANCHOR = say("cure.anchor", "A second anchor would tell.")


def _cure(largest: Cause, settings: TagSettings) -> Sentence:
    """Return what would take the part away: something that the settings do not tell yet, if there is any."""
    if largest in (Cause.NORTH, Cause.BEARING) and settings.start is None:
        return _TELL_START
    if largest is Cause.NORTH and settings.heading_std_rad is None:
        return say("cure.north", "Set how far north may be off where it is (`heading_std_rad`).")
    if largest is Cause.MOUNT and settings.mount_angle_rad is None and settings.motion != "carried":
        return say("cure.mount", "Set the mounting angle (`mount_angle_rad`), or let it turn left and right.")
    if largest is Cause.MOUNT and settings.slip_std_rad is None and settings.motion != "carried":
        return say("cure.rigid", "If it is fixed firmly, say so (`mount_angle_std_rad`, `slip_std_rad`).")
    if largest is Cause.SPEED:
        return say("cure.speed", "Let it turn, or stop for a moment.")
    if largest is Cause.HEIGHT:
        return say("cure.height", "Set its height (`height_m`), or send pressures.")
    if largest is Cause.RANGES:
        return say("cure.ranges", "Free the line of sight, or calibrate the ranges (`range_bias_std_m`).")
    return _SECOND_ANCHOR
