"""What people edit: zones, and rules without a zone."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dropanchor_schemas.zones import EventRule, Zone
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.store.items import NamedItems, adapter_of

MAX_ZONES = 256
MAX_RULES = 100


@dataclass(frozen=True)
class ZoneItems:
    zones: NamedItems[Zone]
    rules: NamedItems[EventRule]

    @classmethod
    def opened(cls, folder: Path | None, recovery: Recovery | None = None) -> Self:
        """Load the files in the folder. recovery: reports those that are damaged. Raises NewerFileError."""

        def path(name: str) -> Path | None:
            return None if folder is None else folder / name

        return cls(
            NamedItems(adapter_of(Zone), path("zones.json"), MAX_ZONES, recovery=recovery),
            NamedItems(adapter_of(EventRule), path("event_rules.json"), MAX_RULES, recovery=recovery),
        )

    @property
    def versions(self) -> Sequence[int]:
        """Numbers of which one grows with every change."""
        return self.zones.version, self.rules.version
