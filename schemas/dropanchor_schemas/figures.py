"""Models of the figures of tags over a period: distance, speed and time in zones."""

from pydantic import BaseModel, ConfigDict, Field


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True)


class FigureZone(_Answer):
    """A zone that tags were in."""

    zone: str = Field(description="Id of the zone.")
    name: str | None = Field(description="Name for people; null: the zone was deleted.")


class TimeInZone(_Answer):
    """How long a tag was in a zone."""

    zone: str = Field(description="Id of the zone.")
    inside_s: float = Field(
        description="From each entry to each exit, with the certainty of an event. A gap without poses counts if the "
        "tag was inside before and after it."
    )
    stays: int = Field(description="How often the tag was inside; a stay that began earlier or goes on counts, too.")


class TagFigures(_Answer):
    """The figures of a tag over the period."""

    tag: str
    poses: int = Field(description="Stored poses in the period.")
    tracked_s: float = Field(description="How long the tag was `tracking` in the frame of the site.")
    distance_m: float = Field(
        description="Length of the way while tracking. A tag that is slower than 0.1 m/s counts as standing."
    )
    mean_speed_mps: float | None = Field(description="Distance by tracked time; null if the tag was never tracking.")
    max_speed_mps: float | None = Field(description="Of the stored poses that were tracking.")
    zones: list[TimeInZone] = Field(description="The zones that the tag was in, ordered by id.")


class Figures(_Answer):
    """Distance, speed and time in zones of each tag over a period."""

    from_ns: int = Field(description="UTC, ns: start of the period.")
    to_ns: int = Field(description="UTC, ns: end of the period.")
    zones: list[FigureZone] = Field(description="The zones that the tags were in, ordered by id.")
    tags: list[TagFigures] = Field(
        description="One for each tag with a stored pose or time in a zone in the period, ordered by name."
    )
