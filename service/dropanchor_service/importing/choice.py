"""What the person chose, and what a source then holds."""

from dataclasses import dataclass, field

from dropanchor_service.importing.readings import Readings
from dropanchor_service.importing.tables.mapping import ColumnMap, Fields
from dropanchor_tag_client.sources.phones.pairing import Signs


@dataclass(frozen=True)
class Choice:
    """What the person chose. columns: of tables. signs: of a phone's accelerations. imu, mag: topics. ranges: topics,
    each with its anchor, None where the messages name it. tag: of a recording of this service."""

    columns: ColumnMap = field(default_factory=ColumnMap)
    signs: Signs = Signs.AUTO
    imu: str | None = None
    mag: str | None = None
    ranges: tuple[tuple[str, str | None], ...] = ()
    tag: str | None = None


@dataclass
class Found:
    """What a source holds. fields: the columns that were used of its tables; guessed: those of tables of which a part
    was guessed. told: the fields of the mapping that it has."""

    readings: Readings
    fields: dict[str, Fields] = field(default_factory=dict)
    guessed: dict[str, Fields] = field(default_factory=dict)
    told: set[str] = field(default_factory=set)
