"""Find the tags that need a person, and say what to do for them."""

from collections.abc import Iterator
from typing import Any, get_args

from dropanchor_schemas.sentences import phrase_of, say
from dropanchor_schemas.tag_health import CareReason
from dropanchor_service.answers.findings import sentence_of
from dropanchor_service.runtime.clock import ahead_or_behind, duration
from dropanchor_service.store import HealthTable, Tag
from dropanchor_service.store.clock_offsets import ClockOffset
from dropanchor_service.store.health import HealthRecord

_WITH_RANGES, _WITH_MOTION = say("with_ranges", "with the ranges"), say("with_motion", "with the motion")
_RANGES_ALWAYS = say("ranges_always", "the ranges always come")
_MOTION_ALWAYS = say("motion_always", "the motion always comes")
_CORRECTED = say("clock_corrected", "the service corrects this. Let one clock stamp both, or set both clocks")
_NOT_CORRECTED = say("clock_advice", "let both devices set their time automatically, and check the network")

BATTERY_LOW = 0.2
SPOOL_RISES = 3  # reports in a row
NO_CONTACT_S = 300.0
REASONS: tuple[CareReason, ...] = get_args(CareReason)


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
    if (clock_error_s := tag.rows.clock_errors.get(tag.row)) is not None:
        hints["clock_wrong"] = wrong_clock(clock_error_s)
    last_ns = max(tag.last_heard_ns or 0, 0 if record is None or tag.last_heard_ns else record.received_ns)
    if last_ns and _age_s(last_ns, now_ns) > NO_CONTACT_S:
        hints["no_contact"] = _no_contact(tag.online, _age_s(last_ns, now_ns))
    return [*_of_sensors(tag), *(_care(reason, hint, None) for reason, hint in hints.items())]


def _care(reason: str, hint: str, setting: dict[str, str | bool] | None) -> dict[str, Any]:
    return {"reason": reason, "hint": hint, "hint_phrase": phrase_of(hint), "setting": setting}


def _of_sensors(tag: Tag) -> Iterator[dict[str, Any]]:
    """Yield a `Care` for each fault of the tag's sensors."""
    for found in tag.rows.findings.of(tag.row):
        setting = None if found.setting is None else dict([found.setting])
        yield _care("sensor_fault", sentence_of(found), setting)


def _of_values(record: HealthRecord, majority: str | None) -> dict[str, str]:
    hints: dict[str, str] = {}
    values = record.values
    if values.get("battery_fraction", 1.0) < BATTERY_LOW:
        hints["battery_low"] = say(
            "battery_low", "The battery is at {share}: charge it.", share=f"{values['battery_fraction']:.0%}"
        )
    firmware = values.get("firmware")
    if None not in (firmware, majority) and firmware != majority:
        hints["firmware_differs"] = say(
            "firmware_differs",
            "Runs firmware {firmware}, most tags run {majority}: update it.",
            firmware=firmware,
            majority=majority,
        )
    if record.spool_rises >= SPOOL_RISES:
        megabytes = values["spool_bytes"] / 1e6
        hints["spool_growing"] = say(
            "spool_growing",
            "Its spool grows ({megabytes} MB wait): its network is too slow for its data.",
            megabytes=f"{megabytes:.1f}",
        )
    return hints


def _clock_hint(offset: ClockOffset) -> str | None:
    """Return what to do about the clocks, None if there is nothing to do."""
    if offset.from_motion is not None and offset.disagrees:
        return _disagreement(offset.offset_s, offset.from_motion.offset_s)
    if not offset.is_too_large:
        return None
    return say(
        "clock_offset",
        "The clock of its motion is {offset} s {side} that of its ranges, or {what} so late: {advice}.",
        offset=f"{abs(offset.offset_s):.1f}",
        side=_side(offset.offset_s),
        what=_RANGES_ALWAYS if offset.offset_s > 0 else _MOTION_ALWAYS,
        advice=_CORRECTED if offset.corrected else _NOT_CORRECTED,
    )


def _disagreement(offset_s: float, by_motion_s: float) -> str:
    """Return what to do where the times of the messages and the motion tell different offsets."""
    return say(
        "clocks_disagree",
        "The clock of its motion is {offset} s {side} that of its ranges by the times of the messages, but {other} s "
        "{other_side} by its motion: the messages {late} probably come {delay} s late. Check their network, and "
        "let both devices set their time automatically.",
        offset=f"{abs(offset_s):.1f}",
        side=_side(offset_s),
        other=f"{abs(by_motion_s):.1f}",
        other_side=_side(by_motion_s),
        late=_WITH_RANGES if offset_s > by_motion_s else _WITH_MOTION,
        delay=f"{abs(offset_s - by_motion_s):.1f}",
    )


def wrong_clock(error_s: float) -> str:
    """Return what to do about a clock that is ahead by this much, or behind if that is negative."""
    return say(
        "clock_wrong",
        "Its clock is {time} {side} that of the service: the service corrects this. Let the tag set its time "
        "automatically.",
        time=duration(round(error_s * 1e9)),
        side=_side(error_s),
    )


def _side(offset_s: float) -> str:
    return ahead_or_behind(offset_s > 0)


def _no_contact(online: bool, age_s: float) -> str:
    time = duration(round(age_s * 1e9))
    if online:
        return say("no_samples", "Connected, but has sent no samples for {time}: check its sensors.", time=time)
    return say("no_contact", "Has sent nothing for {time}: check its power and its network.", time=time)


def _age_s(t_ns: int, now_ns: int) -> float:
    return max(0.0, (now_ns - t_ns) * 1e-9)
