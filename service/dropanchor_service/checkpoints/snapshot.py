"""Collect and restore the state that a service needs to continue after a restart."""

import logging
from typing import Any

import numpy as np

from dropanchor_schemas.site import Anchor
from dropanchor_service.checkpoints.format import CheckpointError, Snapshot, UnreadableLayoutError
from dropanchor_service.checkpoints.layouts import name_of, version_of, why_unreadable
from dropanchor_service.checkpoints.migrations import as_they_are, migrated
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.store import LatestPoses, ServedSite, Sites
from dropanchor_service.store.records import put

_log = logging.getLogger(__name__)


class ServiceState:
    """The state of the service. Owned by the ingest thread while that runs."""

    def __init__(self, sites: Sites, latest: LatestPoses, engine: GuardedEngine, publishers: Publishers) -> None:
        self._sites = sites
        self._rows = sites.rows
        self._latest = latest
        self._engine = engine
        self._publishers = publishers
        self._buffers: dict[str, Array] = {}
        self._dtypes = self.snapshot().dtypes
        self.layout = name_of(self._dtypes)

    @property
    def messages(self) -> int:
        """Number of messages so far. Only messages change the state."""
        return int(self._rows.copy_counts()["messages"].sum())

    def snapshot(self) -> Snapshot:
        """Return a copy of the state.

        The next call overwrites it: the memory is reused, because fresh pages from the operating system cost ten times
        as much as copying into them.
        """
        arrays = {"counts": self._rows.copy_counts(), "publishers": self._publishers.columns}
        arrays["times"] = self._publishers.times
        arrays |= {f"latest.{name}": array for name, array in self._latest.state().items()}
        arrays |= {f"engine.{name}": array for name, array in self._engine.state().items()}
        return Snapshot({name: self._copied(name, array) for name, array in arrays.items()}, self._document())

    def as_present(self, layout: str, found: Snapshot) -> Snapshot:
        """Return a snapshot of this or an earlier layout in this one. Raises CheckpointError."""
        why_not = why_unreadable(layout, self.layout)
        if why_not is not None:
            raise UnreadableLayoutError(f"its layout is {why_not}")
        if layout == self.layout:
            return as_they_are(found, self._dtypes)
        try:
            present = migrated(found, version_of(layout) or 0, self._dtypes, self._fresh)
        except CheckpointError as error:
            raise UnreadableLayoutError(f"its layout is {layout}, but {error}") from error
        _log.info("the checkpoint has the earlier layout %s: its %d tags go on", layout, len(found.document["tags"]))
        return present

    def _fresh(self, settings: Array) -> dict[str, Array]:
        return {f"engine.{name}": array for name, array in self._engine.fresh(settings).items()}

    def _document(self) -> dict[str, Any]:
        """Return the names in the order of rows and indices. With several sites, each has the place of its site."""
        only, tags, sites = self._sites.only, self._rows.all(), self._sites.with_former
        if only is not None and len(sites) == 1:
            anchors = [anchor.model_dump() for anchor in only.store.anchors_by_index()]
            return {"site": only.id, "anchors": anchors, "tags": [tag.name for tag in tags]}
        of_sites = [iter(site.store.anchors_by_index()) for site in sites]
        places = self._engine.anchors.sites.tolist()
        return {
            "sites": [site.id for site in sites],
            "anchors": [(place, next(of_sites[place]).model_dump()) for place in places],
            "tags": [(tag.site, tag.name) for tag in tags],
        }

    def keep_buffers_apart(self) -> None:
        """Use new memory for the next snapshot, so that it does not overwrite the last one."""
        self._buffers = {}

    def _copied(self, name: str, array: Array) -> Array:
        buffer = self._buffers.get(name)
        if buffer is None or len(buffer) < len(array):
            spare = len(array) // 8 if buffer is not None else 0
            buffer = self._buffers[name] = np.empty((len(array) + spare, *array.shape[1:]), array.dtype)
        put(buffer, slice(len(array)), array)
        return buffer[: len(array)]

    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot of this layout, before the first message. It may be of other sites, too."""
        self._restore_names(snapshot.document)
        self._rows.restore_counts(snapshot.arrays["counts"])
        self._publishers.columns = snapshot.arrays["publishers"]
        self._publishers.times = snapshot.arrays["times"]
        self._latest.restore(_part(snapshot, "latest"))
        self._forget_deleted()
        self._engine.restore(_part(snapshot, "engine"))

    def _restore_names(self, document: dict[str, Any]) -> None:
        """Give tags their rows and anchors their indices."""
        sites, anchors, tags = self._sites_in(document), document["anchors"], document["tags"]
        if "site" in document:
            anchors, tags = [(0, anchor) for anchor in anchors], [(0, tag) for tag in tags]
        of_sites: list[list[Anchor]] = [[] for _ in self._sites.with_former]
        for place, anchor in anchors:
            of_sites[sites[place].index].append(Anchor.model_validate(anchor))
        for site in self._sites.with_former:
            site.store.restore_indices(of_sites[site.index])
        self._engine.anchors.restore([sites[place].index for place, _ in anchors])
        for place, tag in tags:
            sites[place].tags.register(tag)

    def _sites_in(self, document: dict[str, Any]) -> list[ServedSite]:
        """Return the sites of a document, in its order. One that is no longer served keeps its rows."""
        if "site" in document and self._sites.only is not None:
            return [self._sites.only]
        names = [document["site"]] if "site" in document else document["sites"]
        return [self._sites.find(name) or self._former(name) for name in names]

    def _former(self, name: str) -> ServedSite:
        _log.info("the checkpoint holds the site %s, which is not served: its tags wait until it is again", name)
        return self._sites.add_former(name)

    def _forget_deleted(self) -> None:
        """Delete the tags that were deleted after this snapshot was made, and hide those of sites that left."""
        for tag in self._rows.all():
            if not self._sites.is_served(tag):
                self._rows.hide(tag.row)
                self._latest.forget(tag.row)
            elif self._sites[tag.site].store.was_deleted_after(tag.name, tag.last_heard_ns or 0):
                self._rows.delete(tag.row)
                self._latest.forget(tag.row)


def _part(snapshot: Snapshot, part: str) -> dict[str, Array]:
    prefix = f"{part}."
    return {name.removeprefix(prefix): a for name, a in snapshot.arrays.items() if name.startswith(prefix)}
