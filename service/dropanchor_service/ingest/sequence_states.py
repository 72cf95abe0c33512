"""Look up the publishers of a tag by the tag's key."""

from collections.abc import Callable, Mapping

from dropanchor_service.ingest.publishers import Publishers, SequenceState
from dropanchor_service.store import Sites

StatesOf = Callable[[str], Mapping[int, SequenceState]]
"""Return what was fused, by boot id, for the tag with this key."""


def sequence_states(sites: Sites, publishers: Publishers) -> StatesOf:
    """Return a function that looks up the publishers of a tag by the tag's key."""

    def states_of(key: str) -> Mapping[int, SequenceState]:
        tag = sites.tag_of(key)
        return {} if tag is None else publishers.sequence_states(tag.row)

    return states_of
