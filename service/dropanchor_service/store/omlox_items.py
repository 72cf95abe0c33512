"""What omlox clients say about objects beyond what this service itself keeps: properties, shapes, assignments."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.store.items import NamedItems, adapter_of
from dropanchor_service.store.omlox_models import Fence, LocationProvider, Trackable

MAX_TRACKABLES = 10_000
MAX_PROVIDERS = 20_000
MAX_FENCES = 1000


@dataclass(frozen=True)
class OmloxItems:
    """trackables: of clients, by id. tag_trackables, providers: by tag. fences: by the id of their zone."""

    trackables: NamedItems[Trackable]
    tag_trackables: NamedItems[Trackable]
    providers: NamedItems[LocationProvider]
    fences: NamedItems[Fence]

    @classmethod
    def opened(cls, folder: Path | None, recovery: Recovery | None = None) -> Self:
        """Load the files in the folder. recovery: reports those that are damaged. Raises NewerFileError."""

        def items(model: Any, name: str, limit: int) -> NamedItems[Any]:
            path = None if folder is None else folder / name
            return NamedItems(adapter_of(model), path, limit, recovery=recovery)

        return cls(
            items(Trackable, "omlox_trackables.json", MAX_TRACKABLES),
            items(Trackable, "omlox_tag_trackables.json", MAX_PROVIDERS),
            items(LocationProvider, "omlox_providers.json", MAX_PROVIDERS),
            items(Fence, "omlox_fences.json", MAX_FENCES),
        )
