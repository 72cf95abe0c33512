"""Models of a heat map: for how long tags were where."""

from pydantic import Field

from dropanchor_schemas.models import Frozen


class HeatCells(Frozen):
    """Square cells that hold any time, as columns of equal length."""

    x: list[float] = Field(description="East, m: the centre of the cell in the frame of the site.")
    y: list[float] = Field(description="North, m.")
    seconds: list[float] = Field(description="How long tags were in the cell: the sum over all tags.")


class HeatMap(Frozen):
    """For how long tags were where over a period."""

    from_ns: int = Field(description="UTC, ns: start of the period, inclusive.")
    to_ns: int = Field(description="UTC, ns: end of the period, inclusive.")
    tags: int = Field(description="How many of the selected tags have stored poses in the period.")
    cell_m: float = Field(
        description="Side of a cell. Larger than requested where there would be more than 20,000 cells."
    )
    placed_s: float = Field(description="The sum of the seconds of all cells.")
    left_out_s: float = Field(
        description="How long the tags had poses that are no places of the map: `ambiguous`, `initialising`, `lost`, "
        "or in a frame of their own. Times over 10 s without a pose count neither here nor in the cells."
    )
    cells: HeatCells
