"""Follow a condition of the single tags of a site, such as a low battery, by their place among them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.zones import AmbiguousRule, BatteryLowRule, LostRule, TagRule
from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.store.groups import Groups
from dropanchor_service.store.records import enlarged
from dropanchor_service.zones.concerned import concerned

RECHARGED = 0.05  # above its limit, a battery can be low again


class TagChange(NamedTuple):
    """The condition began (`is_on`) or ended."""

    place: int
    is_on: bool
    since_ns: int


class FleetState(NamedTuple):
    """The state of all tags of a site by place.

    state: State at this time, -1 without a pose. battery: fraction, NaN: unknown.
    """

    state: Array
    battery: Array


def conditions(rule: TagRule, fleet: FleetState) -> tuple[Array, Array]:
    """Return for which tags the condition of a rule holds, and for which it surely does not."""
    match rule:
        case BatteryLowRule(fraction=limit):
            return fleet.battery < limit, fleet.battery > limit + RECHARGED
        case LostRule():
            return fleet.state == State.LOST, (fleet.state >= 0) & (fleet.state != State.LOST)
        case AmbiguousRule():
            return fleet.state == State.AMBIGUOUS, fleet.state == State.TRACKING


def measured(rule: TagRule, fleet: FleetState, place: int) -> dict[str, float]:
    """Return what the event of a tag says of it, as in `EventData`."""
    is_charge = isinstance(rule, BatteryLowRule)
    return {"battery_fraction": round(float(fleet.battery[place]), 4)} if is_charge else {}


class TagWatch:
    """One rule and the tags for which it holds. One thread owns it.

    Delays count from what this process has seen, so that a restart makes no event.
    """

    def __init__(self, rule: TagRule, groups: Groups) -> None:
        self.rule = rule
        self._groups = groups
        self._on = np.zeros(0, bool)
        self._pending_ns = np.zeros(0, np.int64)
        self._delay_ns = 0 if isinstance(rule, BatteryLowRule) else round(rule.after_s * 1e9)

    def restore(self, place: int) -> None:
        self._grow(place + 1)
        self._on[place] = True

    def judge(self, fleet: FleetState, names: Sequence[str], now_ns: int) -> list[TagChange]:
        """Return what has changed. names: by place."""
        n = len(names)
        self._grow(n)
        starts, ends = conditions(self.rule, fleet)
        on, pending = self._on[:n], self._pending_ns[:n]
        begins = starts & ~on & concerned([self.rule], self._groups, names)[:, 0]
        pending[~begins] = 0
        pending[begins & (pending == 0)] = now_ns
        begun = np.flatnonzero(begins & (now_ns - pending >= self._delay_ns))
        ended = np.flatnonzero(on & ends)
        changes = [TagChange(place, True, int(pending[place])) for place in begun.tolist()]
        on[begun], on[ended], pending[begun] = True, False, 0
        return changes + [TagChange(place, False, now_ns) for place in ended.tolist()]

    def _grow(self, tags: int) -> None:
        if tags > len(self._on):
            self._on = enlarged(self._on, 2 * tags)
            self._pending_ns = enlarged(self._pending_ns, 2 * tags)
