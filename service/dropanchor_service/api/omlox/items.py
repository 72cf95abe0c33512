"""What omlox clients say about objects beyond what this service itself keeps: properties, shapes, assignments."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dropanchor_service.api.omlox.models import Fence, LocationProvider, Trackable
from dropanchor_service.store.items import NamedItems, adapter_of

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
    def opened(cls, folder: Path | None) -> Self:
        """Load the files in the folder. Raises OSError or pydantic's ValidationError."""

        def path(name: str) -> Path | None:
            return None if folder is None else folder / name

        return cls(
            NamedItems(adapter_of(Trackable), path("omlox_trackables.json"), MAX_TRACKABLES),
            NamedItems(adapter_of(Trackable), path("omlox_tag_trackables.json"), MAX_PROVIDERS),
            NamedItems(adapter_of(LocationProvider), path("omlox_providers.json"), MAX_PROVIDERS),
            NamedItems(adapter_of(Fence), path("omlox_fences.json"), MAX_FENCES),
        )
