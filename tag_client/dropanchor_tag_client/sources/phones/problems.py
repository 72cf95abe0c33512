"""Why the readings of a phone give no motion: a sentence for the person who holds the phone."""

from collections.abc import Collection, Iterable, Mapping

from dropanchor_tag_client.sources.phones.readings import GRAVITY, GYROSCOPE, LINEAR, TITLES, TOTAL

TILTED = (
    "Lay the phone flat with its screen up until this message goes away: only gravity tells whether accelerations have "
    "the sign of Android or of an iPhone. Or add signs=ios or signs=android to the Push URL; with MQTT, start the "
    "bridge with --signs ios or --signs android."
)
APART = (
    "No acceleration is within 250 ms of a reading of Gyroscope: set the sampling rate of the sensors that are "
    "switched on to 100 Hz."
)
_ANY_ACCELERATION = f"{TITLES[TOTAL]} (Android) or {TITLES[LINEAR]} and {TITLES[GRAVITY]} (iPhone)"


def lacking(seen: Collection[str]) -> str:
    """Return which sensors are to be switched on, from those that were seen. Return nothing if none lacks."""
    missing = [] if GYROSCOPE in seen else [TITLES[GYROSCOPE]]
    if TOTAL not in seen:
        both = [name for name in (LINEAR, GRAVITY) if name not in seen]
        missing += [_ANY_ACCELERATION] if len(both) == 2 else [TITLES[name] for name in both]
    return f"No motion can be used yet: switch on {', and '.join(missing)}." if missing else ""


def damaged_in(needed: Iterable[str], streams: Collection[str], damaged: Mapping[str, str]) -> str:
    """Return what is wrong with a needed sensor of which a batch has damaged readings and no others.

    streams: sensors that have good readings in the batch. damaged: by sensor, what is wrong.
    """
    for name in needed:
        if name in damaged and name not in streams:
            return (
                f"The readings of {TITLES[name]} {damaged[name]}: start the recording again. If that does not help, "
                "this sensor of the phone does not work."
            )
    return ""
