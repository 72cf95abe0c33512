"""Refuse what works for one site only, so far, when there are several."""

from collections.abc import Iterator

from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError

_OF_EVENTS = ("events", "delivery", "email", "mqtt")


def refuse_for_several_sites(settings: Settings) -> None:
    """Raise SettingsError when there are several sites and something is set that works for one site only."""
    if len(settings.sites) < 2:
        return
    found = [
        f"{key} is for one site so far, and there are {len(settings.sites)}: {what}" for key, what in _of_one(settings)
    ]
    if found:
        raise SettingsError("\n".join(found))


def _of_one(settings: Settings) -> Iterator[tuple[str, str]]:
    """Yield each key that is of one site only, and what to do about it."""
    if settings.data_dir is not None and settings.history.enabled:
        yield "history", "set history.enabled = false"
    if settings.recording.enabled:
        yield "recording", "set recording.enabled = false"
    if settings.basemap.tiles is not None:
        yield "basemap", "leave out basemap.tiles"
    for section in _OF_EVENTS:
        if section in settings.model_fields_set:
            yield section, f"leave out [{section}]"
