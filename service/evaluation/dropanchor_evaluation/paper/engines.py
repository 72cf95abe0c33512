"""The engines for raw samples and recordings: four variants of the paper's filter, and the engine fleet."""

from collections.abc import Callable
from dataclasses import replace

from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED, PaperParameters
from dropanchor_service.estimation.protocols import Engine

WITHOUT_SPEED = 1.0  # blend: full weight on the speed of the EKF


def engines() -> dict[str, Callable[[], Engine]]:
    """Return the constructors of the engines by name. Tuned: the tuned parameters of the service."""

    def paper(parameters: PaperParameters) -> Callable[[], Engine]:
        return lambda: PaperEngine(parameters)

    return {
        "vanilla EKF, authors'": paper(replace(PaperParameters(), blend=WITHOUT_SPEED)),
        "Algorithm 1, authors'": paper(PaperParameters()),
        "vanilla EKF, tuned": paper(replace(TUNED, blend=WITHOUT_SPEED)),
        "Algorithm 1, tuned": paper(TUNED),
        "fleet": FleetEngine,
    }
