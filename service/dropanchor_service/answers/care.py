"""Find the tags that need a person, and say what to do for them."""

from collections.abc import Iterator
from typing import Any

from dropanchor_service.store import HealthTable, Tag
from dropanchor_service.store.clock_offsets import ClockOffset
from dropanchor_service.store.health import HealthRecord

BATTERY_LOW = 0.2
SPOOL_RISES = 3  # reports in a row
NO_CONTACT_S = 300.0
REASONS = ("sensor_fault", "battery_low", "firmware_differs", "spool_growing", "clock_offset", "no_contact")


def health_answer(record: HealthRecord | None, now_ns: int) -> dict[str, Any] | None:
    """Return the `TagHealth` of a record."""
    if record is None:
        return None
    values = {name: value for name, value in record.values.items() if name != "settings"}
    return {"age_s": _age_s(record.received_ns, now_ns)} | values


def care_of(
    tag: Tag, health: HealthTable, now_ns: int, clock_offset: ClockOffset | None = None
) -> list[dict[str, Any]]:
    """Return a `Care` for everything that a person should do for the tag."""
    record = health.of(tag.row)
    hints = {} if record is None else _of_values(record, health.majority_firmware)
    if clock_offset is not None and (clock_hint := _clock_hint(clock_offset)):
        hints["clock_offset"] = clock_hint
    last_ns = max(tag.last_heard_ns or 0, 0 if record is None or tag.last_heard_ns else record.received_ns)
    if last_ns and _age_s(last_ns, now_ns) > NO_CONTACT_S:
        hints["no_contact"] = _no_contact(tag.online, _age_s(last_ns, now_ns))
    return [*_of_sensors(tag), *({"reason": reason, "hint": hint, "setting": None} for reason, hint in hints.items())]


def _of_sensors(tag: Tag) -> Iterator[dict[str, Any]]:
    """Yield a `Care` for each fault of the tag's sensors."""
    for found in tag.rows.findings.of(tag.row):
        setting = None if found.setting is None else dict([found.setting])
        yield {"reason": "sensor_fault", "hint": found.sentence, "setting": setting}


def _of_values(record: HealthRecord, majority: str | None) -> dict[str, str]:
    hints = {}
    values = record.values
    if values.get("battery_fraction", 1.0) < BATTERY_LOW:
        hints["battery_low"] = f"The battery is at {values['battery_fraction']:.0%}: charge it."
    firmware = values.get("firmware")
    if None not in (firmware, majority) and firmware != majority:
        hints["firmware_differs"] = f"Runs firmware {firmware}, most tags run {majority}: update it."
    if record.spool_rises >= SPOOL_RISES:
        megabytes = values["spool_bytes"] / 1e6
        hints["spool_growing"] = f"Its spool grows ({megabytes:.1f} MB wait): its network is too slow for its data."
    return hints


def _clock_hint(offset: ClockOffset) -> str | None:
    """Return what to do about the clocks, None if there is nothing to do."""
    where = f"The clock of its motion is {_where(offset.offset_s)} that of its ranges"
    if offset.from_motion is not None and offset.disagrees:
        delay_s = offset.offset_s - offset.from_motion.offset_s
        late = "the ranges" if delay_s > 0 else "the motion"
        return (
            f"{where} by the times of the messages, but {_where(offset.from_motion.offset_s)} by its motion: the "
            f"messages with {late} probably come {abs(delay_s):.1f} s late. Check their network, and let both devices "
            "set their time automatically."
        )
    if not offset.is_too_large:
        return None
    side = "the ranges always come" if offset.offset_s > 0 else "the motion always comes"
    if offset.corrected:
        return f"{where}, or {side} so late: the service corrects this. Let one clock stamp both, or set both clocks."
    return f"{where}, or {side} so late: let both devices set their time automatically, and check the network."


def _where(offset_s: float) -> str:
    return f"{abs(offset_s):.1f} s {'ahead of' if offset_s > 0 else 'behind'}"


def _no_contact(online: bool, age_s: float) -> str:
    minutes = f"{age_s / 60:.0f} minutes" if age_s < 7200 else f"{age_s / 3600:.0f} hours"
    if online:
        return f"Connected, but has sent no samples for {minutes}: check its sensors."
    return f"Has sent nothing for {minutes}: check its power and its network."


def _age_s(t_ns: int, now_ns: int) -> float:
    return max(0.0, (now_ns - t_ns) * 1e-9)
