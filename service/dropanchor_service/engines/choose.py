"""Create the engine that the settings choose."""

from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.engines.warm_up import warm_up
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.runtime.kernel_cache import use_kernel_cache
from dropanchor_service.runtime.processors import usable_processors
from dropanchor_service.settings.model import Settings


def create_engine(settings: Settings, progress: CompilationProgress | None = None) -> Engine:
    """Return a compiled engine. Only the chosen one is imported: filterpy takes seconds, the first compile a minute."""
    match settings.engine:
        case "paper":
            from dropanchor_service.estimation.paper.engine import PaperEngine

            return PaperEngine(settings.paper.values())
        case "fleet":
            use_kernel_cache()
            from dropanchor_service.estimation.fleet.engine import FleetEngine

            warm_up(FleetEngine(), progress)
            return FleetEngine(max_lag_s=settings.ingest.max_lag_s, threads=threads_of(settings))


def threads_of(settings: Settings) -> int:
    """Return how many threads share the tags."""
    if settings.engine_threads == "auto":
        return max(int(usable_processors()), 1)
    return settings.engine_threads
