"""Compile whatever the service will run, so that no sample waits for it."""

from dropanchor_service.engines.choose import create_engine
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.engines.compile_apart import compile_apart
from dropanchor_service.engines.warm_up import warm_up_answers, warm_up_ingest, warm_up_zones
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.settings.model import Settings


def compiled_engine(settings: Settings, progress: CompilationProgress) -> Engine:
    """Return the engine, with its kernels and those of all else compiled. progress: shown to people meanwhile."""
    if settings.engine == "fleet":
        compile_apart(progress)
    warm_up_ingest(progress)
    warm_up_answers(progress)
    warm_up_zones(progress)
    return create_engine(settings, progress)
