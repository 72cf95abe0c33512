"""What the service and the process that reads a file tell each other."""

from dataclasses import dataclass

from pydantic import BaseModel

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.plans import ImageType, Placement
from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.site import Georeference


class Request(Frozen):
    """What is known of a file.

    media_type: of its content. page: of a PDF, from 1. world: the six numbers of a world file. crs: coordinates of
    the world file or GeoTIFF; empty: not known.
    """

    media_type: str
    page: int = 1
    world: list[float] | None = None
    crs: str = ""
    georeference: Georeference | None = None


class Description(BaseModel):
    """The image that was made, or the problem why there is none."""

    problem: str = ""
    problem_phrase: Phrase | None = None
    media_type: ImageType = "image/png"
    width_px: int = 1
    height_px: int = 1
    pages: int = 1
    placement: Placement | None = None
    note: str = ""
    note_phrase: Phrase | None = None


@dataclass(frozen=True)
class ReadPlan:
    description: Description
    content: bytes
