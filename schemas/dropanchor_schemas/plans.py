"""Models of floor plans: an image, where it lies in the site frame, and the floor that it shows."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field, FiniteFloat, model_validator

from dropanchor_schemas.models import Exact
from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Id, Label, Number, NumberOnly, StrictBool
from dropanchor_schemas.zones import Coordinate

MAX_SIDE_PX = 30_000
MAX_CONTROL_POINTS = 20
MAX_HEIGHT_M = 10_000.0
MAX_M_PER_PX = 1000.0

ImageType = Literal["image/png", "image/jpeg", "image/svg+xml"]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]
Height = Annotated[FiniteFloat, Field(ge=-MAX_HEIGHT_M, le=MAX_HEIGHT_M), NumberOnly]
Pixel = Annotated[FiniteFloat, Field(ge=-MAX_SIDE_PX, le=2 * MAX_SIDE_PX), NumberOnly]


class PlanImage(Exact):
    """An image that was uploaded. Its content never changes."""

    id: str = Field(pattern="^[0-9a-f]{32}$", description="Id of the image: a digest of its content.")
    media_type: ImageType
    width_px: Side
    height_px: Side


class Placement(Exact):
    """Where an image lies in the site frame: it is moved, turned and scaled, but not distorted."""

    x: Coordinate = Field(description="Centre of the image, m.")
    y: Coordinate = Field(description="Centre of the image, m.")
    rotation_rad: Number = Field(
        default=0.0, description="Direction of the rows of the image, counter-clockwise from the site's x axis."
    )
    m_per_px: Annotated[FiniteFloat, Field(gt=0, le=MAX_M_PER_PX), NumberOnly] = Field(
        description="Length of a pixel on the ground."
    )


class ControlPoint(Exact):
    """A place on the image, and where it lies in the site frame."""

    column_px: Pixel = Field(description="Distance from the left edge of the image.")
    row_px: Pixel = Field(description="Distance from the upper edge of the image.")
    x: Coordinate
    y: Coordinate


class Floor(Exact):
    """A floor. Plans with the same name of a floor belong together."""

    name: Annotated[Label, Field(min_length=1)]
    bottom_m: Height = Field(description="Lower end of its heights, along the anchors' z axis.")
    top_m: Height = Field(description="Upper end of its heights, which belongs to the floor above.")

    @model_validator(mode="after")
    def _top_is_above_bottom(self) -> "Floor":
        if self.top_m <= self.bottom_m:
            raise ValueError(say("floor_order", "top_m must be above bottom_m"))
        return self


class Plan(Exact):
    """A floor plan below the tags on the map."""

    id: Id = Field(description="Id of the plan, as in its path.")
    name: Label = Field(default="", description="Name for people.")
    image: PlanImage = Field(description="The image, as the upload answered.")
    placement: Placement
    opacity: Annotated[FiniteFloat, Field(ge=0, le=1), NumberOnly] = Field(
        default=0.7, description="0: invisible; 1: opaque."
    )
    dark_inverted: StrictBool = Field(
        default=True, description="Whether the dark page inverts it: right for line drawings, wrong for photos."
    )
    floor: Floor | None = Field(default=None, description="The floor that it shows; null: it belongs to all floors.")
    control_points: Annotated[list[ControlPoint], Field(max_length=MAX_CONTROL_POINTS)] = Field(
        default=[], description="The points by which a person aligned it. `placement` holds the result."
    )


class PlanList(BaseModel):
    """The floor plans of the site."""

    plans: list[Plan]


class UploadedPlanImage(BaseModel):
    """An image that the service has stored, and where it lies if the file says so."""

    image: PlanImage
    pages: int = Field(ge=1, description="Pages of the file; 1 unless it is a PDF.")
    placement: Placement | None = Field(description="Where the image lies; null: align it by hand.")
    note: str = Field(description="What a person should know about the placement; may be empty.")
    note_phrase: Phrase | None = Field(default=None, description="The note by its code; null without one.")
