"""What people edit: zones, groups of tags, and rules without a zone."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dropanchor_schemas.zones import EventRule, TagGroup, Zone
from dropanchor_service.store.items import NamedItems, adapter_of

MAX_ZONES = 256
MAX_GROUPS = 1000
MAX_RULES = 100


@dataclass(frozen=True)
class ZoneItems:
    zones: NamedItems[Zone]
    groups: NamedItems[TagGroup]
    rules: NamedItems[EventRule]

    @classmethod
    def opened(cls, folder: Path | None) -> Self:
        """Load the files in the folder. Raises OSError or pydantic's ValidationError."""

        def path(name: str) -> Path | None:
            return None if folder is None else folder / name

        return cls(
            NamedItems(adapter_of(Zone), path("zones.json"), MAX_ZONES),
            NamedItems(adapter_of(TagGroup), path("tag_groups.json"), MAX_GROUPS),
            NamedItems(adapter_of(EventRule), path("event_rules.json"), MAX_RULES),
        )

    @property
    def versions(self) -> Sequence[int]:
        """Numbers of which one grows with every change."""
        return self.zones.version, self.groups.version, self.rules.version
