"""Which anchor seems to stand elsewhere than the site says, as a hint about the poses that rest on it."""

from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from dropanchor_schemas.sentences import Sentence, say
from dropanchor_service.estimation.columns import Array, StateReason
from dropanchor_service.store.anchor_doubts import AnchorDoubt
from dropanchor_service.store.tags import TagTable


def sentence_of(doubt: AnchorDoubt) -> Sentence:
    """Return where an anchor seems to stand, and what to do."""
    return anchor_moved(*doubt) if doubt.since_ns else anchor_misplaced(doubt.anchor, doubt.way_m)


def anchor_moved(anchor: str, way_m: float, since_ns: int) -> Sentence:
    return say(
        "anchor_moved",
        "Anchor {anchor} seems to have moved by {way} m or more at {time} UTC: say where it is, or save it again to "
        "confirm its place.",
        anchor=anchor,
        way=f"{way_m:.1f}",
        time=datetime.fromtimestamp(since_ns // 10**9, UTC).strftime("%H:%M:%S"),
    )


def anchor_misplaced(anchor: str, way_m: float) -> Sentence:
    return say(
        "anchor_misplaced",
        "Anchor {anchor}, or another one that its tags hear, seems to stand about {way} m from where the site says: "
        "measure their places again, or save it again to confirm its place.",
        anchor=anchor,
        way=f"{way_m:.1f}",
    )


def about_anchors(poses: Array, tags: TagTable) -> Iterator[tuple[str, int]]:
    """Yield which anchor seems to stand elsewhere, and the place of each pose that rests on it."""
    for place in np.flatnonzero(poses["reason"] == StateReason.ANCHOR_DOUBTED).tolist():
        if (doubt := tags.rows.anchor_doubts.of(int(poses["row"][place]))) is not None:
            yield sentence_of(doubt), place
