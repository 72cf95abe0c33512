"""The zone in which a site's times are written for people."""

from typing import Annotated
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, Field

from dropanchor_schemas.sentences import say


def _known(name: str) -> str:
    try:
        ZoneInfo(name)
    except (KeyError, OSError, ValueError) as error:
        raise ValueError(
            say(
                "time_zone_unknown",
                "the service knows no time zone {name}: give one such as Europe/Berlin",
                name=repr(name),
            )
        ) from error
    return name


TimeZone = Annotated[
    str,
    Field(
        min_length=1,
        max_length=64,
        description="Zone of the times on the page and in mails, such as Europe/Berlin; null: that of each browser, "
        "and in mails that of the service.",
    ),
    AfterValidator(_known),
]
