"""Refuse what works for one site only, so far, when there are several."""

from collections.abc import Iterator

from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError

MOST_WITH_FILES = 100  # that write a history or record at once: each has a thread of its own, and perhaps files
_OF_EVENTS = ("events", "delivery", "email", "mqtt")


def refuse_for_several_sites(settings: Settings) -> None:
    """Raise SettingsError when there are several sites and something is set that works for one site only."""
    if len(settings.sites) < 2:
        return
    if len(settings.sites) > MOST_WITH_FILES:
        _refuse_many_files(settings)
    found = [
        f"{key} is for one site so far, and there are {len(settings.sites)}: {what}" for key, what in _of_one(settings)
    ]
    if found:
        raise SettingsError("\n".join(found))


def _refuse_many_files(settings: Settings) -> None:
    """Raise SettingsError when more sites than can have one would have a history, or a recording from the start."""
    with_files = {
        "history": settings.history.enabled and (settings.data_dir or settings.history.url) is not None,
        "recording": settings.recording.enabled,
    }
    found = [
        f"{key} is for up to {MOST_WITH_FILES} sites, and there are {len(settings.sites)}: set {key}.enabled = false"
        for key, is_on in with_files.items()
        if is_on
    ]
    if found:
        raise SettingsError("\n".join(found))


def _of_one(settings: Settings) -> Iterator[tuple[str, str]]:
    """Yield each key that is of one site only, and what to do about it."""
    for section in _OF_EVENTS:
        if section in settings.model_fields_set:
            yield section, f"leave out [{section}]"
