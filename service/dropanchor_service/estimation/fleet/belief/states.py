"""Tracking states and reasons as plain integers, which compiled code compares and stores without a detour."""

from typing import Final

from dropanchor_service.estimation.columns import State, StateReason

INITIALISING: Final = int(State.INITIALISING)
AMBIGUOUS: Final = int(State.AMBIGUOUS)
TRACKING: Final = int(State.TRACKING)
COASTING: Final = int(State.COASTING)
DEGRADED: Final = int(State.DEGRADED)
LOST: Final = int(State.LOST)

NO_RANGE: Final = int(StateReason.NO_RANGE)
NO_HEADING_YET: Final = int(StateReason.NO_HEADING)
SEVERAL_MODES: Final = int(StateReason.SEVERAL_MODES)
RESOLVED: Final = int(StateReason.RESOLVED)
RANGES_MISSING: Final = int(StateReason.RANGES_MISSING)
IMU_MISSING: Final = int(StateReason.IMU_MISSING)
RANGES_REJECTED: Final = int(StateReason.RANGES_REJECTED)
UNCERTAIN: Final = int(StateReason.UNCERTAIN)
FAULT: Final = int(StateReason.FAULT)
FRONT_OR_BACK: Final = int(StateReason.FRONT_OR_BACK)
HEADING_UNSURE: Final = int(StateReason.HEADING_UNSURE)
