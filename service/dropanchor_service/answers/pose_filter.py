"""Select the poses that an answer holds: by state, by place, and by the name and the group of the tag."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.answers.columns import aged_poses
from dropanchor_service.answers.frames import STATES, published_states
from dropanchor_service.estimation.columns import Array, Frame
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable


@dataclass(frozen=True)
class PoseFilter:
    """The conditions that a pose has to meet, all of them.

    states: one of these; empty: any. box: x_min, y_min, x_max, y_max of the site, m. text: part of the tag's name, in
    upper or lower case. groups: one of these; empty: any.
    """

    states: Sequence[str] = ()
    box: tuple[float, float, float, float] | None = None
    text: str = ""
    groups: Sequence[str] = ()

    @property
    def is_everything(self) -> bool:
        return not self.states and self.box is None and not self.text and not self.groups

    def matches(self, poses: Array, tags: TagTable, site: SiteStore, now_ns: int) -> Array:
        """Return whether each of these POSE rows, which are the latest, meets the conditions now."""
        matching = np.ones(len(poses), bool)
        if self.states:
            aged = aged_poses(poses, tags.rows.overdue_s(poses, now_ns))
            published = published_states(aged["state"], aged["frame"])
            matching &= np.isin(published, [STATES.index(state) for state in self.states])
        if self.box is not None:
            x_min, y_min, x_max, y_max = self.box
            x, y = poses["x"], poses["y"]
            inside = (x >= x_min) & (x <= x_max) & (y >= y_min) & (y <= y_max)
            matching &= inside & (poses["frame"] == Frame.SITE)
        if self.text:
            text, rows = self.text.casefold(), np.flatnonzero(matching)
            names = tags.rows.names(poses["row"][rows].tolist())
            matching[rows] = [text in name.casefold() for name in names]
        if self.groups:
            rows = np.flatnonzero(matching)
            matching[rows] = site.groups.are_in(tags.rows.names(poses["row"][rows].tolist()), self.groups)
        return matching
