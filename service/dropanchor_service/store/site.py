"""The site, its anchors and its tag settings: configured, changed over REST, saved in a file."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock

from pydantic import BaseModel, ConfigDict

from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Anchor, RemoteSettings, Site, TagSettings
from dropanchor_schemas.wire import anchor_number
from dropanchor_service.runtime.recovery import Recovery, write_with_copy
from dropanchor_service.store.floors import NO_FLOORS
from dropanchor_service.store.groups import Groups, groups_of
from dropanchor_service.store.preconditions import Precondition, always, require
from dropanchor_service.store.shared import Save

FILE_NAME = "site.json"

_log = logging.getLogger(__name__)


class SiteDocument(BaseModel):
    """The content of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    site: Site
    tags: dict[str, TagSettings] = {}
    remote: dict[str, RemoteSettings] = {}
    deleted_ns: dict[str, int] = {}  # tags that were deleted, and when, UTC


class SiteStore:
    """The current site and tag settings, written by the API and the ingest thread, read by any thread.

    The ingest thread writes when it places the first anchor that a tag ranges to. `version` grows with every change,
    so that one comparison detects a change. floors: those of the plans. epoch: grows when another process of a cluster
    takes the site over; 0 without a cluster.
    """

    epoch = 0
    floors = NO_FLOORS

    def __init__(
        self,
        site: Site,
        tags: dict[str, TagSettings],
        folder: Path | None = None,
        tag_defaults: TagSettings | None = None,
        recovery: Recovery | None = None,
    ) -> None:
        """Load the file in `folder` if there is one, else use `site` and `tags`.

        folder: where changes are saved; with None they are lost at a restart. tag_defaults: what a tag gets where its
        own settings say nothing. recovery: reports a file that is damaged.
        Raises NewerFileError.
        """
        self._lock = Lock()
        self.default_settings = tag_defaults or TagSettings()
        self._document = SiteDocument(site=site, tags=tags)
        self._save_bytes: Save | None = None
        self._has_file = False
        if folder is not None:
            self._open_file(folder / FILE_NAME, recovery or Recovery())
        self._anchors: dict[int, tuple[int, Anchor]] = {}  # number → (index for the engine, anchor)
        self._index_anchors()
        self._groups = groups_of(self._document.tags, self.default_settings)
        self._told: list[Callable[[], None]] = []
        self.version = 1

    def _open_file(self, path: Path, recovery: Recovery) -> None:
        self._save_bytes = lambda content: write_with_copy(path, content)
        found = recovery.read(path, SiteDocument.model_validate_json)
        if found is not None:
            self._document = found
            self._has_file = True

    def share(self, saved: bytes | None, save: Save) -> None:
        """Go on from what another process has saved of this site; see `Shared`. Call this before the first message."""
        self._save_bytes = save
        if saved is not None:
            self._anchors = {}
            self._apply(SiteDocument.model_validate_json(saved))
        elif self._has_file:
            self._save(self._document)

    def on_change(self, told: Callable[[], None]) -> None:
        """Call this after every change, on the thread that makes it."""
        self._told.append(told)

    def _tell(self) -> None:
        for told in self._told:
            told()

    @property
    def site(self) -> Site:
        return self._document.site

    @property
    def document(self) -> SiteDocument:
        """Site and tags in one consistent snapshot."""
        return self._document

    @property
    def tags(self) -> dict[str, TagSettings]:
        return self._document.tags

    def tag_settings(self, tag: str) -> TagSettings:
        """Return the settings of the tag, or the defaults when it has none."""
        return self._document.tags.get(tag, self.default_settings)

    def anchor_index(self, number: int) -> int | None:
        """Return the engine's index of the anchor with this number, or None when the site does not have it."""
        entry = self._anchors.get(number)
        return None if entry is None or entry[1] not in self.site.anchors else entry[0]

    def lacks(self, number: int) -> bool:
        """Return whether the site has no anchor with this number."""
        return self.anchor_index(number) is None

    def anchors_by_index(self) -> list[Anchor]:
        """Return every anchor that the site has or had. An index keeps its meaning for the life of the store."""
        return [anchor for _, anchor in sorted(self._anchors.values(), key=lambda entry: entry[0])]

    def restore_indices(self, anchors: Sequence[Anchor]) -> None:
        """Give these anchors of an earlier store, in order of their index, the same index here. Call this first."""
        self._anchors = {anchor.number: (index, anchor) for index, anchor in enumerate(anchors)}
        self._index_anchors()
        self.version += 1
        self._tell()

    def bind_first(self, anchor: str) -> bool:
        """Put `anchor` at the origin if the site has no anchor yet. Return whether it did."""
        with self._lock:
            if self.site.anchors:
                return False
            document = self._document.model_copy(update={"site": _with_anchor(self.site, Anchor(id=anchor))})
            try:
                self._save(document)
            except OSError as error:  # the tags cannot wait for a disk, and nobody relies on the file yet
                _log.error(
                    "anchor %s is the origin, but only until a restart: the site cannot be saved (%s). Make room or "
                    "correct the permissions of data_dir, then set the anchor over REST",
                    anchor,
                    error,
                )
            self._apply(document)
            return True

    def set_site(self, site: Site, allows: Precondition = always) -> None:
        """Replace the site and save it. Raises OSError, and ChangedMeanwhileError when `allows` refuses.

        Raises ValueError when the id differs: Zenoh keys contain it, so it is fixed while the service runs.
        """
        with self._lock:
            require(allows, self.site)
            if site.id != self.site.id:
                raise ValueError(
                    say(
                        "site_id",
                        "the site's id is {site} and cannot change while the service runs",
                        site=repr(self.site.id),
                    )
                )
            self._replace(self._document.model_copy(update={"site": site}))

    def anchor(self, anchor: str) -> Anchor | None:
        """Return the anchor with this id, or None."""
        return next((known for known in self.site.anchors if known.number == anchor_number(anchor)), None)

    def set_anchor(self, anchor: Anchor, allows: Precondition = always) -> None:
        """Add the anchor, or replace the one with its number, and save the site.

        Raises OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            require(allows, self.anchor(anchor.id))
            self._replace(self._document.model_copy(update={"site": _with_anchor(self.site, anchor)}))

    def remove_anchor(self, anchor: str, allows: Precondition = always) -> None:
        """Remove the anchor with this id and save the site.

        Raises KeyError when there is none, OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            known = self.anchor(anchor)
            if known is None:
                raise KeyError(anchor)
            require(allows, known)
            left = [other for other in self.site.anchors if other != known]
            site = self.site.model_copy(update={"anchors": left})
            self._replace(self._document.model_copy(update={"site": site}))

    def set_tag(self, tag: str, settings: TagSettings, allows: Precondition = always) -> None:
        """Replace the settings of the tag and save them. What is not given becomes the default.

        Raises OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            require(allows, self.tag_settings(tag))
            complete = settings.over(self.default_settings)
            update = {"tags": self.tags | {tag: complete}, "deleted_ns": self._deleted_without(tag)}
            self._replace(self._document.model_copy(update=update))

    def remove_tag(self, tag: str, now_ns: int, allows: Precondition = always) -> None:
        """Remove everything that is set for the tag, note when it was deleted, and save that.

        Raises OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            require(allows, self.tag_settings(tag))
            tags, remote = dict(self.tags), dict(self._document.remote)
            tags.pop(tag, None)
            remote.pop(tag, None)
            update = {"tags": tags, "remote": remote, "deleted_ns": self._document.deleted_ns | {tag: now_ns}}
            self._replace(self._document.model_copy(update=update))

    def was_deleted_after(self, tag: str, heard_ns: int) -> bool:
        """Return whether the tag was deleted after it had last sent something."""
        return self._document.deleted_ns.get(tag, -1) >= heard_ns

    def _deleted_without(self, tag: str) -> dict[str, int]:
        return {name: t_ns for name, t_ns in self._document.deleted_ns.items() if name != tag}

    @property
    def groups(self) -> Groups:
        """The groups of the tags. The value never changes."""
        return self._groups

    def remote_settings(self, tag: str) -> RemoteSettings:
        """Return what the program of the tag should apply."""
        return self._document.remote.get(tag, RemoteSettings())

    def set_remote(self, tag: str, settings: RemoteSettings, expected: RemoteSettings | None = None) -> bool:
        """Replace what the program of the tag should apply, and save it. Raises OSError.

        Return False, and change nothing, when the current settings are not the expected ones.
        """
        with self._lock:
            if expected is not None and expected != self.remote_settings(tag):
                return False
            self._replace(self._document.model_copy(update={"remote": self._document.remote | {tag: settings}}))
            return True

    def _replace(self, document: SiteDocument) -> None:
        """Save first, then apply: a restart never loses an acknowledged change. Raises OSError."""
        self._save(document)
        self._apply(document)

    def _save(self, document: SiteDocument) -> None:
        if self._save_bytes is not None:
            self._save_bytes(document.model_dump_json(indent=2).encode())

    def _apply(self, document: SiteDocument) -> None:
        self._document = document
        self._groups = groups_of(document.tags, self.default_settings)
        self._index_anchors()
        self.version += 1
        self._tell()

    def _index_anchors(self) -> None:
        for anchor in self.site.anchors:
            index = self._anchors.get(anchor.number, (len(self._anchors),))[0]
            self._anchors[anchor.number] = (index, anchor)


def _with_anchor(site: Site, anchor: Anchor) -> Site:
    others = [other for other in site.anchors if other.number != anchor.number]
    return Site.model_validate(site.model_dump() | {"anchors": [*others, anchor]})
