"""What share links show of the status of a tag: what the page needs to draw it, and not how it is set up."""

from collections.abc import Callable

from fastapi import Request

from dropanchor_schemas.site import RemoteSettings, TagSettings
from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.http.permissions import Need

_LABELS = frozenset({"name", "colour", "group"})
_SETTINGS = {Need.LINK_TO_TAGS: _LABELS, Need.LINK: _LABELS | {"height_m"}}
"""Settings that a link reads. The page draws the ring of a range by the height."""
_HIDDEN: Answer = {
    "health": None,
    "clock_offset": None,
    "clock_error_s": None,
    "needs_care": [],
    "remote_settings": {"wanted": RemoteSettings().model_dump(), "acknowledged": None},
}


def shown_to(request: Request) -> Callable[[Answer], Answer]:
    """Return what makes of a `TagStatus` the one that the client of a request may read."""
    names = _SETTINGS.get(getattr(request.state, "has", Need.ADMIN))  # without authentication everybody may do all
    return (lambda status: status) if names is None else lambda status: _reduced(status, names)


def _reduced(status: Answer, names: frozenset[str]) -> Answer:
    settings = {name: value for name, value in status["settings"].items() if name in names}
    return status | _HIDDEN | {"settings": TagSettings.model_validate(settings).model_dump()}
