"""The number of every birth. Births that one loop runs have consecutive numbers, in the order in which they run.

Compiled code compares these integers. `table` says what each birth is; `Tuning.births` has a bit for each.
"""

from typing import Final

GIVEN_START: Final = 0
RING: Final = 1
ALIGNED: Final = 2
OWN_ERROR: Final = 3
MOUNT_CELLS: Final = 4
CARRIED_START: Final = 5
PICK_UP: Final = 6
SET_DOWN: Final = 7
SLOW_AHEAD: Final = 8
TURN_AFTER_STOP: Final = 9
DEVICE_TURN: Final = 10
WIDENED: Final = 11
SIGHT_EXPECTED: Final = 12
ROTATIONS: Final = 13
PUSHED_BACK: Final = 14
SIGHT_LOST: Final = 15
SIGHT_BACK: Final = 16
SIGHT_CLOSED: Final = 17
SPLIT_CURVED: Final = 18
SPLIT_WIDE: Final = 19
OWN_ERROR_AGAIN: Final = 20
RING_AGAIN: Final = 21
WALKED_OFF: Final = 22
AFTER_GAP: Final = 23
MIRRORED_START: Final = 24
FIX: Final = 25
BIRTHS: Final = 26

ALL: Final = (1 << BIRTHS) - 1  # all of them on

# Families, each with a file of its own. What is in none replaces all hypotheses, or widens them.
OF_MOUNTING: Final = (ALIGNED, MOUNT_CELLS)
OF_HEADING: Final = (OWN_ERROR, OWN_ERROR_AGAIN)
OF_DIRECTION: Final = (SLOW_AHEAD, TURN_AFTER_STOP, PUSHED_BACK)
OF_SIGHT: Final = (SIGHT_EXPECTED, SIGHT_LOST, SIGHT_BACK, SIGHT_CLOSED)
OF_SPLITTING: Final = (SPLIT_CURVED, SPLIT_WIDE)
