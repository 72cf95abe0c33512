"""Models of where north is at a site, as the tracks of its tags tell it."""

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.pose import Phrase


class TagNorth(Frozen):
    """What the track of one tag tells."""

    tag: str
    declination_rad: float = Field(description="That makes its magnetic north that of the site.")
    std_rad: float = Field(description="Standard deviation of that.")


class SiteNorth(Frozen):
    """What the tags together tell, whose start and heading were told and whose magnetometer counts.

    Tags of one site differ by 0.14 rad (8°) beside what each is unsure of: by the iron around them and by how they are
    mounted. `std_rad` counts that.
    """

    declination_rad: float = Field(description="The declination of the site.")
    learned_rad: float | None = Field(description="The declination that the tags tell; null if none does.")
    std_rad: float | None = Field(description="Standard deviation of `learned_rad`.")
    tags: list[TagNorth] = Field(description="The tags that tell it.")
    offered: bool = Field(
        description="Whether `learned_rad` differs from `declination_rad` by more than two standard deviations, so "
        "that it should be the site's. To apply it, put the site with `learned_rad` as `declination_rad` and `std_rad` "
        "as `declination_std_rad`."
    )
    text: str = Field(description="The same as a sentence; empty where nothing is offered.")
    phrase: Phrase | None = Field(description="That sentence by its code.")
