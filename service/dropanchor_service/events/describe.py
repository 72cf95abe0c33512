"""Describe changes as events."""

from typing import Any

from dropanchor_schemas.zones import EventRule, EventType, Severity, TagRule, TooCloseRule, Zone
from dropanchor_service.events.drafts import AlarmBegan, Draft, StateKey, rounded
from dropanchor_service.zones.judge import DWELL, DWELT, ENTER, EXIT, INSIDE, SPEED, TOO_FAST
from dropanchor_service.zones.pair_watch import PairChange
from dropanchor_service.zones.tag_watch import FleetState, TagChange, measured
from dropanchor_service.zones.zone_watch import ZoneChange

_OF_ZONES = {
    ENTER: EventType.ZONE_ENTER,
    EXIT: EventType.ZONE_EXIT,
    DWELL: EventType.ZONE_DWELL,
    SPEED: EventType.ZONE_SPEED,
}
_OF_RULES = {kind.rpartition(".")[2]: kind for kind in EventType}
_FLAG_OF = {ENTER: INSIDE, DWELL: DWELT, SPEED: TOO_FAST}
_ACTIVE = 1


def severities(item: Zone | EventRule) -> dict[int, Severity]:
    """Return what a zone or rule makes, by the flag of the state that it sets then."""
    if isinstance(item, Zone):
        return {INSIDE: item.enter_severity, DWELT: item.dwell_severity, TOO_FAST: item.speed_severity}
    return {_ACTIVE: item.severity}


def zone_event(change: ZoneChange, key: StateKey) -> Draft | None:
    """Return the event of a tag in a zone, None where the zone does not want it."""
    zone, pose, flag = change.zone, change.pose, _FLAG_OF.get(change.kind)
    is_silent = change.kind == ENTER and not zone.enter and zone.enter_severity is Severity.EVENT
    if change.kind not in _OF_ZONES or is_silent or (change.kind == EXIT and not zone.exit):
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
    return _draft(_OF_ZONES[change.kind], zone, key, data, flag)


def pair_event(rule: TooCloseRule, change: PairChange, key: StateKey, now_ns: int) -> Draft:
    """Return the event of two tags that are too close."""
    data = _rule_data(rule, now_ns, change.since_ns) | {
        "probability": rounded(change.p),
        "other_tag": key.other,
        "distance_m": rounded(change.distance_m),
    }
    return _draft(_OF_RULES[rule.type], rule, key, data)


def tag_event(rule: TagRule, change: TagChange, key: StateKey, fleet: FleetState, now_ns: int) -> Draft:
    """Return the event of a single tag."""
    data = _rule_data(rule, now_ns, change.since_ns) | measured(rule, fleet, change.place)
    return _draft(_OF_RULES[rule.type], rule, key, data)


def _draft(
    kind: EventType, item: Zone | EventRule, key: StateKey, data: dict[str, Any], flag: int | None = _ACTIVE
) -> Draft:
    """Return the event, which begins an alarm if the zone or rule says so. flag: that the state gets."""
    severity = Severity.EVENT if flag is None else severities(item)[flag]
    is_muted = item.is_muted_at(data["t_ns"])
    if flag is None or severity is Severity.EVENT:
        return Draft(kind, key.tag, data, is_muted=is_muted)
    return Draft(kind, key.tag, data | {"severity": severity.value}, AlarmBegan(key, flag), is_muted)


def _rule_data(rule: EventRule, now_ns: int, since_ns: int) -> dict[str, Any]:
    return {"t_ns": now_ns, "since_ns": since_ns, "rule": rule.id, "name": rule.name}
