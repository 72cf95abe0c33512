"""The site, its anchors and its tag settings: configured, changed over REST, and what was changed saved in a file."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock

from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Anchor, RemoteSettings, Site, TagSettings
from dropanchor_schemas.wire import anchor_number
from dropanchor_service.runtime.recovery import Recovery, write_with_copy
from dropanchor_service.settings.layers import Layer
from dropanchor_service.store.anchor_indices import AnchorIndices
from dropanchor_service.store.floors import NO_FLOORS
from dropanchor_service.store.groups import Groups, groups_of
from dropanchor_service.store.preconditions import Precondition, always, require
from dropanchor_service.store.shared import Save
from dropanchor_service.store.site_values import Configured, SetValues, SiteDocument, nothing_set, values_in, without
from dropanchor_service.store.trail import NO_TRAIL, Change, Trail

FILE_NAME = "site.json"

_log = logging.getLogger(__name__)


class SiteStore:
    """The current site and tag settings, written by the API and the ingest thread, read by any thread.

    The ingest thread writes when it places the first anchor that a tag ranges to. `version` grows with every change,
    so that one comparison detects a change. floors: those of the plans. epoch: grows when another process of a cluster
    takes the site over; 0 without a cluster. layers: where the configured values are from. anchors_told: how often
    somebody said where one is.
    """

    epoch = 0
    floors, anchors_told = NO_FLOORS, 0
    layers: Sequence[Layer] = ()

    def __init__(
        self,
        site: Site,
        tags: dict[str, TagSettings],
        folder: Path | None = None,
        tag_defaults: TagSettings | None = None,
        recovery: Recovery | None = None,
    ) -> None:
        """Load what was set over REST from the file in `folder`, if there is one. The rest is as in `site` and `tags`.

        folder: where changes are saved; with None they are lost at a restart. tag_defaults: what a tag gets where its
        own settings say nothing. recovery: reports a file that is damaged.
        Raises NewerFileError.
        """
        self._lock = Lock()
        self.default_settings = tag_defaults or TagSettings()
        self.configured = Configured(site, tags, self.default_settings)
        self.trail: Trail = NO_TRAIL
        self._values = nothing_set(site.id)
        self._save_bytes: Save | None = None
        self._has_file = False
        if folder is not None:
            self._open_file(folder / FILE_NAME, recovery or Recovery())
        self._document = self._values.in_force(self.configured)
        self._indices = AnchorIndices(self.site.anchors)
        self._groups = groups_of(self._document.tags, self.default_settings)
        self.on_change: list[Callable[[], None]] = []  # called after every change, on the thread that makes it
        self.version = 1

    def _open_file(self, path: Path, recovery: Recovery) -> None:
        self._save_bytes = lambda content: write_with_copy(path, content)
        found = recovery.read(path, self._parsed)
        if found is None:
            return
        self._values, is_older = found
        self._has_file = True
        if is_older:
            self._migrate()

    def _parsed(self, content: bytes) -> tuple[SetValues, bool]:
        return values_in(content, self.configured)

    def _migrate(self) -> None:
        """Save what an older file has as set, before somebody changes the settings and more of it seems to be."""
        named = [*self._values.anchors, *(tag for tag, own in self._values.tags.items() if own.model_fields_set)]
        _log.info("%s was of an older form: of its anchors and tags, %s count as set over REST", FILE_NAME, named[:20])
        try:
            self._save(self._values)
        except OSError as error:
            _log.error("%s cannot be saved (%s): the next start tries again", FILE_NAME, error)

    def take_over(self) -> None:
        """Make the file this site's, although it names another one. Raises OSError."""
        site = self._values.site.model_copy(update={"id": self.site.id})
        self._values = self._values.model_copy(update={"site": site})
        self._save(self._values)

    def configure(self, configured: Configured) -> None:
        """Let this be what the settings say. What was set over REST stays."""
        with self._lock:
            self.configured, self.default_settings = configured, configured.defaults
            self._apply(self._values, self._values.in_force(configured))

    def share(self, saved: bytes | None, save: Save) -> None:
        """Go on from what another process has saved of this site; see `Shared`. Call this before the first message."""
        self._save_bytes = save
        if saved is not None:
            self._indices = AnchorIndices()
            values, is_older = self._parsed(saved)
            self._apply(values, values.in_force(self.configured))
            if is_older:
                self._migrate()
        elif self._has_file:
            self._save(self._values)

    @property
    def site(self) -> Site:
        return self._document.site

    @property
    def values(self) -> SetValues:
        """What was set over REST. The value never changes."""
        return self._values

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
        anchor = self._indices.anchor(number)
        return None if anchor is None or anchor not in self.site.anchors else self._indices.index(number)

    def lacks(self, number: int) -> bool:
        """Return whether the site has no anchor with this number."""
        return self.anchor_index(number) is None

    def anchors_by_index(self) -> list[Anchor]:
        """Return every anchor that the site has or had. An index keeps its meaning for the life of the store."""
        return self._indices.all()

    def restore_indices(self, anchors: Sequence[Anchor]) -> None:
        """Give these anchors of an earlier store, in order of their index, the same index here. Call this first."""
        self._indices = AnchorIndices(anchors)
        self._apply(self._values, self._document)

    def bind_first(self, anchor: str) -> bool:
        """Put `anchor` at the origin if the site has no anchor yet. Return whether it did."""
        with self._lock:
            if self.site.anchors:
                return False
            first = Anchor(id=anchor)
            site = self._document.site_with(first)
            values = self._values.with_first(first, site, self.configured)
            document = self._document.model_copy(update={"site": site})
            try:
                self._replace(values, document, Change("anchor", anchor, None, first))
            except OSError as error:  # the tags cannot wait for a disk, and nobody relies on the file yet
                _log.error(
                    "anchor %s is the origin, but only until a restart: the site cannot be saved (%s). Make room or "
                    "correct the permissions of data_dir, then set the anchor over REST",
                    anchor,
                    error,
                )
                self._apply(values, document)
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
            self.anchors_told += 1
            self._replace_site(site, Change("site", site.id, self.site, site))

    def anchor(self, anchor: str) -> Anchor | None:
        """Return the anchor with this id, or None."""
        return next((known for known in self.site.anchors if known.number == anchor_number(anchor)), None)

    def set_anchor(self, anchor: Anchor, allows: Precondition = always) -> None:
        """Add the anchor, or replace the one with its number, and save the site.

        Raises OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            before = self.anchor(anchor.id)
            require(allows, before)
            self.anchors_told += 1
            self._replace_site(self._document.site_with(anchor), Change("anchor", anchor.id, before, anchor))

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
            self._replace_site(self.site.model_copy(update={"anchors": left}), Change("anchor", known.id, known, None))

    def set_tag(self, tag: str, settings: TagSettings, allows: Precondition = always) -> None:
        """Replace the settings of the tag and save them. What is not given becomes the default.

        Raises OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            require(allows, self.tag_settings(tag))
            complete = settings.over(self.default_settings)
            values = self._values.with_tag(tag, complete, self.configured)
            update = {"tags": self.tags | {tag: complete}, "deleted_ns": values.deleted_ns}
            change = Change("tag", tag, self.tags.get(tag), complete)
            self._replace(values, self._document.model_copy(update=update), change)

    def remove_tag(self, tag: str, now_ns: int, allows: Precondition = always) -> None:
        """Remove everything that is set for the tag, note when it was deleted, and save that.

        Raises OSError, and ChangedMeanwhileError when `allows` refuses.
        """
        with self._lock:
            require(allows, self.tag_settings(tag))
            update = {
                "tags": without(tag, self._values.tags),
                "remote": without(tag, self._values.remote),
                "deleted_ns": self._values.deleted_ns | {tag: now_ns},
            }
            document = self._document.model_copy(update=update | {"tags": without(tag, self.tags)})
            change = Change("tag", tag, self.tags.get(tag), None)
            self._replace(self._values.model_copy(update=update), document, change)

    def was_deleted_after(self, tag: str, heard_ns: int) -> bool:
        """Return whether the tag was deleted after it had last sent something."""
        return self._document.deleted_ns.get(tag, -1) >= heard_ns

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
            update = {"remote": self._document.remote | {tag: settings}}
            change = Change("remote-settings", tag, self._document.remote.get(tag), settings)
            self._replace(self._values.model_copy(update=update), self._document.model_copy(update=update), change)
            return True

    def _replace_site(self, site: Site, change: Change) -> None:
        document = self._document.model_copy(update={"site": site})
        self._replace(self._values.with_site(site, self.configured), document, change)

    def _replace(self, values: SetValues, document: SiteDocument, change: Change) -> None:
        """Note and save first, then apply: a restart never loses an acknowledged change. Raises OSError."""
        with self.trail.changing(change):
            self._save(values)
        self._apply(values, document)

    def _save(self, values: SetValues) -> None:
        if self._save_bytes is not None:
            self._save_bytes(values.to_bytes())

    def _apply(self, values: SetValues, document: SiteDocument) -> None:
        self._values, self._document = values, document
        self._groups = groups_of(document.tags, self.default_settings)
        self._indices.add(self.site.anchors)
        self.version += 1
        for told in self.on_change:
            told()
