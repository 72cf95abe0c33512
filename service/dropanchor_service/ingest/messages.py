"""The messages of a turn, as one value that the stages of the ingest pass on."""

from typing import NamedTuple

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.decode import Forms


class Messages(NamedTuple):
    """Messages in order of arrival. Those that have waited for others come first. Arrays have one entry for each.

    read: what their payloads are. rows: i4, of their tags. arrived: i8, ns. waited: how many have waited before.
    """

    read: Forms
    rows: Array
    arrived: Array
    waited: int
