"""Find the tags that a zone or a rule concerns."""

from collections.abc import Sequence

import numpy as np

from dropanchor_schemas.zones import Concerned
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.groups import Groups


def concerned(items: Sequence[Concerned], groups: Groups, names: Sequence[str]) -> Array:
    """Return, for each of these tags (rows) and items (columns), whether the item concerns the tag."""
    mask = np.ones((len(names), len(items)), bool)
    for column, item in enumerate(items):
        if item.tags or item.groups:
            listed = set(item.tags)
            mask[:, column] = np.logical_or([name in listed for name in names], groups.are_in(names, item.groups))
    return mask
