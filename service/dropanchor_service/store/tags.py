"""The tags of one site that have sent messages or are configured, by name."""

from threading import Lock

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.presence import Presence
from dropanchor_service.store.rows import KINDS, REASONS, Rows, Tag
from dropanchor_service.store.unknown_anchors import UnknownAnchors

__all__ = ["KINDS", "REASONS", "Rows", "Tag", "TagTable"]


class TagTable:
    """Maps the names of the tags of one site to rows, which the tables of several sites share.

    site: index of the site. rows: where the tags get their rows; None: rows of its own. path: where REST has the site.
    """

    def __init__(self, rows: Rows | None = None, site: int = 0, path: str = "/api/v1") -> None:
        self._lock = Lock()
        self._site = site
        self._by_name: dict[str, Tag] = {}
        self.rows = Rows() if rows is None else rows
        self.arrivals = self.rows.arrivals
        self.presence = Presence(until=self.rows.online_until)
        self.unknown_anchors = UnknownAnchors(path)

    def __len__(self) -> int:
        return len(self._by_name)

    @property
    def has_every_row(self) -> bool:
        """Whether there are no tags of other sites."""
        return len(self._by_name) == len(self.rows)

    def own(self, poses: Array) -> Array:
        """Return those of these POSE that are of tags of this site."""
        return poses if self.has_every_row else poses[self.rows.sites(poses["row"]) == self._site]

    def find(self, name: str) -> Tag | None:
        """Return the tag of this name, or None."""
        return self._by_name.get(name)

    def all(self) -> list[Tag]:
        """Return every tag that has a row, in the order of the rows."""
        return list(self._by_name.values())

    def listed(self) -> list[Tag]:
        """Return every tag that is not deleted."""
        deleted = self.rows.deleted
        return [tag for tag in self.all() if tag.row not in deleted]

    def register(self, name: str) -> Tag:
        """Return the tag of this name; add it when it is new, and list it again when it was deleted."""
        with self._lock:
            tag = self._by_name.get(name)
            if tag is None:
                tag = self._by_name[name] = self.rows.add(self._site, name, self.presence)
            elif self.is_deleted(tag.row):
                self.rows.undelete(tag.row)
            return tag

    def delete(self, row: int) -> None:
        """Clear the counters of a row, and take its tag off the list until it is registered again."""
        self.rows.delete(row)

    def is_deleted(self, row: int) -> bool:
        """Return whether the tag of this row was deleted and not registered again."""
        return row in self.rows.deleted
