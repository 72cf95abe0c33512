"""The site, its anchors and the settings of its tags: from the configuration, changed over REST, kept in a file."""

import logging
from collections.abc import Sequence
from pathlib import Path
from threading import Lock

from pydantic import BaseModel, ConfigDict

from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_schemas.wire import anchor_number
from dropanchor_service.runtime.atomic_file import write_atomically

FILE_NAME = "site.json"

_log = logging.getLogger(__name__)


class SiteDocument(BaseModel):
    """What the file holds."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    site: Site
    tags: dict[str, TagSettings] = {}


class SiteStore:
    """Written by the API and by the ingest thread (which binds the first anchor it hears); read by all.

    version: grows with every change, so that the ingest thread notices one with a single comparison.
    """

    def __init__(self, site: Site, tags: dict[str, TagSettings], folder: Path | None = None) -> None:
        """folder: where changes are kept over a restart; None keeps them in memory. Its file wins over `site`.

        Raises OSError or pydantic's ValidationError when the file cannot be read.
        """
        self._lock = Lock()
        self._nothing_known = TagSettings()
        self._path = None if folder is None else folder / FILE_NAME
        self._document = SiteDocument(site=site, tags=tags)
        if self._path is not None and self._path.exists():
            self._document = SiteDocument.model_validate_json(self._path.read_bytes())
        self._anchors: dict[int, tuple[int, Anchor]] = {}  # number → (index for the engine, anchor)
        self._index_anchors()
        self.version = 1

    @property
    def site(self) -> Site:
        return self._document.site

    @property
    def document(self) -> SiteDocument:
        """Site and tags of one moment."""
        return self._document

    @property
    def tags(self) -> dict[str, TagSettings]:
        return self._document.tags

    def tag_settings(self, tag: str) -> TagSettings:
        return self._document.tags.get(tag, self._nothing_known)

    def anchor_index(self, number: int) -> int | None:
        """The engine's index of the anchor with this number, None when the site does not have it."""
        entry = self._anchors.get(number)
        return None if entry is None or entry[1] not in self.site.anchors else entry[0]

    def lacks(self, number: int) -> bool:
        """Whether the site has no anchor with this number."""
        return self.anchor_index(number) is None

    def anchors_by_index(self) -> list[Anchor]:
        """Every anchor the site has or had: an index keeps its meaning for the life of the store."""
        return [anchor for _, anchor in sorted(self._anchors.values(), key=lambda entry: entry[0])]

    def remember(self, anchors: Sequence[Anchor]) -> None:
        """Give the anchors that another store had, by its index, the same index here. Before anything else is done."""
        self._anchors = {anchor.number: (index, anchor) for index, anchor in enumerate(anchors)}
        self._index_anchors()

    def bind_first(self, anchor: str) -> bool:
        """Put `anchor` at the origin if the site has none yet. True when it did."""
        with self._lock:
            if self.site.anchors:
                return False
            document = self._document.model_copy(update={"site": _with_anchor(self.site, Anchor(id=anchor))})
            try:
                self._keep(document)
            except OSError as error:  # nobody has been told that it is kept, and the tags cannot wait for a disk
                _log.error("anchor %s is the origin until a restart: it cannot be kept: %s", anchor, error)
            self._take_over(document)
            return True

    def set_site(self, site: Site) -> None:
        """Raises ValueError when the id differs: keys are made of it, so it is fixed while the service runs."""
        with self._lock:
            if site.id != self.site.id:
                raise ValueError(f"the site's id is {self.site.id!r} and cannot change while the service runs")
            self._replace(self._document.model_copy(update={"site": site}))

    def set_anchor(self, anchor: Anchor) -> None:
        with self._lock:
            self._replace(self._document.model_copy(update={"site": _with_anchor(self.site, anchor)}))

    def remove_anchor(self, anchor: str) -> None:
        """Raises KeyError when there is none of this id."""
        with self._lock:
            left = [other for other in self.site.anchors if other.number != anchor_number(anchor)]
            if len(left) == len(self.site.anchors):
                raise KeyError(anchor)
            site = self.site.model_copy(update={"anchors": left})
            self._replace(self._document.model_copy(update={"site": site}))

    def set_tag(self, tag: str, settings: TagSettings) -> None:
        with self._lock:
            self._replace(self._document.model_copy(update={"tags": self.tags | {tag: settings}}))

    def _replace(self, document: SiteDocument) -> None:
        """The file is written first: what was acknowledged is not lost by a restart. Raises OSError."""
        self._keep(document)
        self._take_over(document)

    def _keep(self, document: SiteDocument) -> None:
        if self._path is not None:
            write_atomically(self._path, [document.model_dump_json(indent=2).encode()])

    def _take_over(self, document: SiteDocument) -> None:
        self._document = document
        self._index_anchors()
        self.version += 1

    def _index_anchors(self) -> None:
        for anchor in self.site.anchors:
            index = self._anchors.get(anchor.number, (len(self._anchors),))[0]
            self._anchors[anchor.number] = (index, anchor)


def _with_anchor(site: Site, anchor: Anchor) -> Site:
    others = [other for other in site.anchors if other.number != anchor.number]
    return Site.model_validate(site.model_dump() | {"anchors": [*others, anchor]})
