"""The words of mails in English and German."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime

from dropanchor_schemas.destinations import Language
from dropanchor_schemas.events import EventType, RetractionReason


@dataclass(frozen=True)
class Words:
    """How a mail says things in one language. sentences: of one event; kinds: what events of several tags share.

    In them stand `{tag}`, `{other}`, `{place}`, `{number}` and `{lasted}` for the values of the event; of one about
    another event, such as a retraction, `{before}` for the kind of that; `{why}` for the reason, and `{who}` and
    `{note}` for an acknowledgement.
    """

    sentences: Mapping[EventType, str]
    kinds: Mapping[EventType, str]
    reasons: Mapping[RetractionReason, str]
    number: Callable[[float, int], str]
    time: Callable[[datetime], str]
    probability: str
    event: str
    more: str
    events: str
    page: str


def _english_number(value: float, decimals: int) -> str:
    return f"{value:,.{decimals}f}"


def _german_number(value: float, decimals: int) -> str:
    return f"{value:,.{decimals}f}".translate(str.maketrans(",.", ".,"))


_ENGLISH = Words(
    sentences={
        EventType.ZONE_ENTER: "{tag} entered {place}",
        EventType.ZONE_EXIT: "{tag} left {place}",
        EventType.ZONE_DWELL: "{tag} has been in {place} for {lasted}",
        EventType.ZONE_SPEED: "{tag} is too fast in {place}: {number} m/s",
        EventType.TAGS_TOO_CLOSE: "{tag} and {other} are too close: {number} m",
        EventType.TAG_BATTERY_LOW: "The battery of {tag} is low: {number} %",
        EventType.TAG_LOST: "{tag} has been lost for {lasted}",
        EventType.TAG_AMBIGUOUS: "{tag} has been ambiguous for {lasted}",
        EventType.EVENT_RETRACTED: "Retracted for {tag}: {before} ({why})",
        EventType.ALARM_OVER: "Over for {tag}: {before} (after {lasted})",
        EventType.ALARM_ACKNOWLEDGED: "Acknowledged for {tag}: {before} {who} {note}",
        EventType.DESTINATION_TEST: "This is a test of the destination {tag}",
    },
    kinds={
        EventType.ZONE_ENTER: "entered {place}",
        EventType.ZONE_EXIT: "left {place}",
        EventType.ZONE_DWELL: "too long in {place}",
        EventType.ZONE_SPEED: "too fast in {place}",
        EventType.TAGS_TOO_CLOSE: "too close: {place}",
        EventType.TAG_BATTERY_LOW: "battery low: {place}",
        EventType.TAG_LOST: "lost: {place}",
        EventType.TAG_AMBIGUOUS: "ambiguous: {place}",
        EventType.EVENT_RETRACTED: "retracted: {before}",
        EventType.ALARM_OVER: "over: {before}",
        EventType.ALARM_ACKNOWLEDGED: "acknowledged: {before}",
        EventType.DESTINATION_TEST: "test of {place}",
    },
    reasons={
        RetractionReason.START_DENIED: "the ranges contradict where it was said to start",
        RetractionReason.START_TAKEN_BACK: "what was said about its start was taken back",
    },
    number=_english_number,
    time=lambda when: f"{when:%Y-%m-%d %H:%M:%S %Z}",
    probability="probability",
    event="event",
    more="and {count} more events",
    events="{count} events:",
    page="The page:",
)

_GERMAN = Words(
    sentences={
        EventType.ZONE_ENTER: "{tag} ist jetzt in {place}",
        EventType.ZONE_EXIT: "{tag} hat {place} verlassen",
        EventType.ZONE_DWELL: "{tag} ist seit {lasted} in {place}",
        EventType.ZONE_SPEED: "{tag} ist zu schnell in {place}: {number} m/s",
        EventType.TAGS_TOO_CLOSE: "{tag} und {other} sind sich zu nah: {number} m",
        EventType.TAG_BATTERY_LOW: "Die Batterie von {tag} ist schwach: {number} %",
        EventType.TAG_LOST: "{tag} ist seit {lasted} verloren",
        EventType.TAG_AMBIGUOUS: "{tag} ist seit {lasted} mehrdeutig",
        EventType.EVENT_RETRACTED: "Zurückgezogen für {tag}: {before} ({why})",
        EventType.ALARM_OVER: "Vorbei für {tag}: {before} (nach {lasted})",
        EventType.ALARM_ACKNOWLEDGED: "Quittiert für {tag}: {before} {who} {note}",
        EventType.DESTINATION_TEST: "Dies ist ein Test des Ziels {tag}",
    },
    kinds={
        EventType.ZONE_ENTER: "jetzt in {place}",
        EventType.ZONE_EXIT: "{place} verlassen",
        EventType.ZONE_DWELL: "zu lange in {place}",
        EventType.ZONE_SPEED: "zu schnell in {place}",
        EventType.TAGS_TOO_CLOSE: "zu nah: {place}",
        EventType.TAG_BATTERY_LOW: "Batterie schwach: {place}",
        EventType.TAG_LOST: "verloren: {place}",
        EventType.TAG_AMBIGUOUS: "mehrdeutig: {place}",
        EventType.EVENT_RETRACTED: "zurückgezogen: {before}",
        EventType.ALARM_OVER: "vorbei: {before}",
        EventType.ALARM_ACKNOWLEDGED: "quittiert: {before}",
        EventType.DESTINATION_TEST: "Test: {place}",
    },
    reasons={
        RetractionReason.START_DENIED: "die Distanzen widersprechen dem angegebenen Startort",
        RetractionReason.START_TAKEN_BACK: "die Angabe des Startorts wurde zurückgenommen",
    },
    number=_german_number,
    time=lambda when: f"{when:%d.%m.%Y %H:%M:%S %Z}",
    probability="Wahrscheinlichkeit",
    event="Ereignis",
    more="und {count} weitere Ereignisse",
    events="{count} Ereignisse:",
    page="Die Seite:",
)

WORDS: Mapping[Language, Words] = {Language.ENGLISH: _ENGLISH, Language.GERMAN: _GERMAN}
