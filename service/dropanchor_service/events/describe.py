"""Describe changes as events."""

from collections.abc import Callable, Sequence
from typing import Any

from dropanchor_schemas.events import EventType
from dropanchor_schemas.zones import EventRule, TooCloseRule
from dropanchor_service.events.drafts import Draft, rounded
from dropanchor_service.zones.judge import DWELL, ENTER, EXIT, SPEED
from dropanchor_service.zones.pair_watch import PairChange
from dropanchor_service.zones.tag_watch import FleetState, TagChange
from dropanchor_service.zones.zone_watch import ZoneChange

_OF_ZONES = {
    ENTER: EventType.ZONE_ENTER,
    EXIT: EventType.ZONE_EXIT,
    DWELL: EventType.ZONE_DWELL,
    SPEED: EventType.ZONE_SPEED,
}
_OF_RULES = {
    "battery_low": EventType.TAG_BATTERY_LOW,
    "lost": EventType.TAG_LOST,
    "ambiguous": EventType.TAG_AMBIGUOUS,
}
NameOf = Callable[[int], str]


def zone_event(change: ZoneChange, name_of: NameOf) -> Draft | None:
    """Return the event of a tag in a zone, None where the zone does not want it. name_of: tag by row."""
    zone, pose = change.zone, change.pose
    if (change.kind == ENTER and not zone.enter) or (change.kind == EXIT and not zone.exit):
        return None
    data: dict[str, Any] = {
        "t_ns": change.t_ns,
        "since_ns": change.since_ns,
        "zone": zone.id,
        "name": zone.name,
        "x": rounded(pose["x"]),
        "y": rounded(pose["y"]),
        "probability": rounded(change.p),
        "speed_mps": rounded(pose["speed"]),
    }
    return Draft(_OF_ZONES[change.kind], name_of(change.row), data)


def pair_event(rule: TooCloseRule, change: PairChange, now_ns: int, name_of: NameOf) -> Draft:
    """Return the event of two tags that are too close."""
    tag, other = map(name_of, change.rows)
    data = _rule_data(rule, now_ns, change.since_ns) | {
        "probability": rounded(change.p),
        "other_tag": other,
        "distance_m": rounded(change.distance_m),
    }
    return Draft(EventType.TAGS_TOO_CLOSE, tag, data)


def tag_event(rule: EventRule, change: TagChange, fleet: FleetState, now_ns: int, names: Sequence[str]) -> Draft:
    """Return the event of a single tag. names: of the tags of its site."""
    data = _rule_data(rule, now_ns, change.since_ns)
    if rule.type == "battery_low":
        data["battery_fraction"] = rounded(fleet.battery[change.place])
    return Draft(_OF_RULES[rule.type], names[change.place], data)


def _rule_data(rule: EventRule, now_ns: int, since_ns: int) -> dict[str, Any]:
    return {"t_ns": now_ns, "since_ns": since_ns, "rule": rule.id, "name": rule.name}
