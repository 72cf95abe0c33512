"""Scenarios by name: the paper's motions, and random families limited to a range of distances."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from dropanchor_tag_client.simulator.families import Legs, Line, Wandering
from dropanchor_tag_client.simulator.ground import Forklift, Rolling
from dropanchor_tag_client.simulator.noise import Stream, stream
from dropanchor_tag_client.simulator.shapes import fig4_line, paper_stages, ten_stages, triangle, tum_letters
from dropanchor_tag_client.simulator.trajectory import Trajectory

MIN_DISTANCE_M = 0.7
MAX_DISTANCE_M = 120.0

FAMILIES: Mapping[str, Legs | Line | Wandering | Rolling | Forklift] = MappingProxyType(
    {
        "S5": Legs(),
        "M5": Legs(arc_probability=0.5),
        "C5": Legs(speed=(0.2, 1.2), leg_s=(10.0, 20.0), min_change=0.0, arc_probability=0.5, arc_rate=(0.05, 0.35)),
        "OU": Wandering(),
        "L1": Line(),
        "SG": Legs(stop_s=(3.0, 6.0)),
        "RV": Legs(backwards=(1, 3)),
        "rolling": Rolling(),
        "forklift": Forklift(),
    }
)

SHAPES: Mapping[str, Callable[[], Trajectory]] = MappingProxyType(
    {
        "P": paper_stages,
        "fig3-straight": lambda: ten_stages(arcs=False),
        "fig3-arcs": lambda: ten_stages(arcs=True),
        "fig4": fig4_line,
        "triangle": triangle,
        "TUM": tum_letters,
    }
)

SCENARIOS = (*SHAPES, *FAMILIES)


class UnknownScenarioError(ValueError):
    """A scenario that does not exist."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no scenario {name!r}; there are {', '.join(SCENARIOS)}")


def trajectory(scenario: str, seed: int) -> Trajectory:
    """Return the motion of a scenario. Shapes do not depend on the seed; families do.

    Families are redrawn until the distance to the anchor at the origin stays between 0.7 m and 120 m. Raises
    UnknownScenarioError.
    """
    if scenario in SHAPES:
        return SHAPES[scenario]()
    if scenario not in FAMILIES:
        raise UnknownScenarioError(scenario)
    rng = stream(seed, Stream.MOTION)
    drawn = FAMILIES[scenario].draw(rng)
    while not keeps_distance(drawn):
        drawn = FAMILIES[scenario].draw(rng)
    return drawn


def keeps_distance(motion: Trajectory) -> bool:
    distance = motion.distance
    return bool(distance.min() >= MIN_DISTANCE_M and distance.max() <= MAX_DISTANCE_M)
