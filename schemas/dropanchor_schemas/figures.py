"""Models of the figures of tags over a period: distance, speed and time in zones."""

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.tracks import TagSummary


class FigureZone(Frozen):
    """A zone that tags were in."""

    zone: str = Field(description="Id of the zone.")
    name: str | None = Field(description="Name for people; null: the zone was deleted.")


class TimeInZone(Frozen):
    """How long a tag was in a zone."""

    zone: str = Field(description="Id of the zone.")
    inside_s: float = Field(
        description="From each entry to each exit, with the certainty of an event. A gap without poses counts if the "
        "tag was inside before and after it."
    )
    stays: int = Field(description="How often the tag was inside; a stay that began earlier or goes on counts, too.")


class TagFigures(TagSummary):
    """The figures of a tag over the period."""

    zones: list[TimeInZone] = Field(description="The zones that the tag was in, ordered by id.")


class Figures(Frozen):
    """Distance, speed and time in zones of each tag over a period."""

    from_ns: int = Field(description="UTC, ns: start of the period.")
    to_ns: int = Field(description="UTC, ns: end of the period.")
    zones: list[FigureZone] = Field(description="The zones that the tags were in, ordered by id.")
    tags: list[TagFigures] = Field(
        description="One for each tag with a stored pose or time in a zone in the period, ordered by name."
    )
