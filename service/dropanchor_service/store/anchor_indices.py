"""The engine's index of each anchor that a site has or had. An index keeps its meaning for the life of a store."""

from collections.abc import Sequence

from dropanchor_schemas.site import Anchor


class AnchorIndices:
    def __init__(self, anchors: Sequence[Anchor] = ()) -> None:
        self._anchors: dict[int, Anchor] = {}  # by number, in the order of their indices
        self.add(anchors)

    def add(self, anchors: Sequence[Anchor]) -> None:
        """Add the new ones among these anchors, and note where the others are now."""
        self._anchors |= {anchor.number: anchor for anchor in anchors}

    def anchor(self, number: int) -> Anchor | None:
        return self._anchors.get(number)

    def index(self, number: int) -> int:
        """Return the index of an anchor. Raises KeyError."""
        return list(self._anchors).index(number)

    def all(self) -> list[Anchor]:
        return list(self._anchors.values())
