"""Collect and restore the state that a service needs to continue after a restart."""

import numpy as np

from dropanchor_schemas.site import Anchor
from dropanchor_service.checkpoints.files import Snapshot, layout_of
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.runtime.kernel_cache import sources_digest
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.store.records import put


class ServiceState:
    """The state of the service. Owned by the ingest thread while that runs."""

    def __init__(
        self, site: SiteStore, tags: TagTable, latest: LatestPoses, engine: GuardedEngine, publishers: Publishers
    ) -> None:
        self._site = site
        self._tags = tags
        self._latest = latest
        self._engine = engine
        self._publishers = publishers
        self._buffers: dict[str, Array] = {}
        self.template = self.snapshot()
        self.layout = layout_of(self.template, meaning=sources_digest())

    @property
    def messages(self) -> int:
        """Number of messages so far. Only messages change the state."""
        return int(self._tags.copy_counts()["messages"].sum())

    def snapshot(self) -> Snapshot:
        """Return a copy of the state.

        The next call overwrites it: the memory is reused, because fresh pages from the operating system cost ten times
        as much as copying into them.
        """
        arrays = {"counts": self._tags.copy_counts(), "publishers": self._publishers.columns}
        arrays["times"] = self._publishers.times
        arrays |= {f"latest.{name}": array for name, array in self._latest.state().items()}
        arrays |= {f"engine.{name}": array for name, array in self._engine.state().items()}
        anchors = [anchor.model_dump() for anchor in self._site.anchors_by_index()]
        document = {"site": self._site.site.id, "anchors": anchors, "tags": [tag.name for tag in self._tags.all()]}
        return Snapshot({name: self._copied(name, array) for name, array in arrays.items()}, document)

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
        """Restore a snapshot of this layout, before the first message."""
        self._site.restore_indices([Anchor.model_validate(anchor) for anchor in snapshot.document["anchors"]])
        self._tags.restore(snapshot.document["tags"], snapshot.arrays["counts"])
        self._publishers.columns = snapshot.arrays["publishers"]
        self._publishers.times = snapshot.arrays["times"]
        self._latest.restore(_part(snapshot, "latest"))
        self._forget_deleted()
        self._engine.restore(_part(snapshot, "engine"))

    def _forget_deleted(self) -> None:
        """Delete the tags that were deleted after this snapshot was made."""
        for tag in self._tags.all():
            if self._site.was_deleted_after(tag.name, tag.last_heard_ns or 0):
                self._tags.delete(tag.row)
                self._latest.forget(tag.row)


def _part(snapshot: Snapshot, part: str) -> dict[str, Array]:
    prefix = f"{part}."
    return {name.removeprefix(prefix): a for name, a in snapshot.arrays.items() if name.startswith(prefix)}
