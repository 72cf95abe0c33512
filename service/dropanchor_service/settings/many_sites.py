"""Refuse what works for fewer sites than there are."""

from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError

MOST_WITH_FILES = 100  # that write a history or record at once: each has a thread of its own, and perhaps files


def refuse_too_many_sites(settings: Settings) -> None:
    """Raise SettingsError when more sites than can have one would have a history, or a recording from the start."""
    if len(settings.sites) <= MOST_WITH_FILES:
        return
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
