"""Find the tags that a zone or a rule concerns."""

from collections.abc import Mapping, Sequence

import numpy as np

from dropanchor_schemas.zones import Concerned, TagGroup
from dropanchor_service.estimation.columns import Array


def with_members(groups: Mapping[str, TagGroup], members: Mapping[str, Sequence[str]]) -> Mapping[str, TagGroup]:
    """Return the groups, each with the tags whose settings name it as well."""
    both = dict(groups)
    for group, tags in members.items():
        listed = both[group].tags if group in both else []
        both[group] = TagGroup.model_construct(id=group, tags=[*listed, *tags])
    return both


def concerned(items: Sequence[Concerned], groups: Mapping[str, TagGroup], names: Sequence[str]) -> Array:
    """Return, for each of these tags (rows) and items (columns), whether the item concerns the tag."""
    mask = np.ones((len(names), len(items)), bool)
    for column, item in enumerate(items):
        if item.tags or item.groups:
            listed = set(item.tags).union(*(groups[group].tags for group in item.groups if group in groups))
            mask[:, column] = [name in listed for name in names]
    return mask
