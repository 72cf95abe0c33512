"""The births of hypotheses by number and name. What each is, and what for, says `service/docs/reference/births.md`."""

from typing import Final

GIVEN_START, RING, OWN_ERROR, MOUNT_CELLS, CARRIED_START, PICK_UP, SET_DOWN = range(7)
SLOW_AHEAD, TURN_AFTER_STOP, DEVICE_TURN, WIDENED = range(7, 11)
SIGHT_EXPECTED, ROTATIONS, PUSHED_BACK = range(11, 14)
SIGHT_LOST, SIGHT_BACK, SPLIT_CURVED = range(14, 17)
SPLIT_WIDE, OWN_ERROR_AGAIN, RING_AGAIN = range(17, 20)
WALKED_OFF, AFTER_GAP, MIRRORED_START, FIX = range(20, 24)
NAMES: Final = (
    *("given-start", "ring", "own-error", "mount-cells", "carried-start", "pick-up", "set-down"),
    *("ahead-while-slow", "turned-after-stop", "turned-device", "widened"),
    *("sight-expected", "rotations", "pushed-back"),
    *("sight-lost", "sight-back", "split-curved"),
    *("split-wide", "own-error-again", "ring-again"),
    *("walked-off", "after-gap", "mirrored-start", "fix"),
)  # by number
ALL: Final = (1 << len(NAMES)) - 1  # all of them on


class NoBirthError(ValueError):
    """No birth has this name."""


def without(*names: str) -> int:
    """Return `Tuning.births` with these births switched off. Raises NoBirthError."""
    switched_on = ALL
    for name in names:
        if name not in NAMES:
            raise NoBirthError(f"no birth is named {name!r}; take one of {', '.join(NAMES)}")
        switched_on &= ~(1 << NAMES.index(name))
    return switched_on
