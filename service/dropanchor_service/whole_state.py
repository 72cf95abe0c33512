"""All that a restarted service must know to go on as if it had not been away: what a checkpoint holds."""

from dropanchor_schemas.site import Anchor
from dropanchor_service.estimation.batch import Array
from dropanchor_service.estimators import Estimators
from dropanchor_service.kernel_cache import sources_digest
from dropanchor_service.publishers import Publishers
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.store.checkpoints import Snapshot, layout_of


class WholeState:
    """Owned by the ingest thread while it runs."""

    def __init__(
        self, site: SiteStore, tags: TagTable, latest: LatestPoses, estimators: Estimators, publishers: Publishers
    ) -> None:
        self._site = site
        self._tags = tags
        self._latest = latest
        self._estimators = estimators
        self._publishers = publishers
        self.template = self.snapshot()
        self.layout = layout_of(self.template, meaning=sources_digest())

    @property
    def messages(self) -> int:
        """How many have come in: nothing else changes the state."""
        return int(self._tags.copy_counts()["messages"].sum())

    def snapshot(self) -> Snapshot:
        """Copies: what comes in later does not change them."""
        arrays = {"counts": self._tags.copy_counts(), "publishers": self._publishers.columns.copy()}
        arrays |= {f"latest.{name}": array for name, array in self._latest.state().items()}
        arrays |= {f"engine.{name}": array for name, array in self._estimators.state().items()}
        anchors = [anchor.model_dump() for anchor in self._site.anchors_by_index()]
        document = {"site": self._site.site.id, "anchors": anchors, "tags": [tag.name for tag in self._tags.all()]}
        return Snapshot(arrays, document)

    def restore(self, snapshot: Snapshot) -> None:
        """Take over a snapshot of this layout, before anything has come in."""
        self._site.remember([Anchor.model_validate(anchor) for anchor in snapshot.document["anchors"]])
        self._tags.restore(snapshot.document["tags"], snapshot.arrays["counts"])
        self._publishers.columns = snapshot.arrays["publishers"]
        self._latest.restore(_part(snapshot, "latest"))
        self._estimators.restore(_part(snapshot, "engine"))


def _part(snapshot: Snapshot, part: str) -> dict[str, Array]:
    prefix = f"{part}."
    return {name.removeprefix(prefix): a for name, a in snapshot.arrays.items() if name.startswith(prefix)}
