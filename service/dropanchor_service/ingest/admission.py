"""Which tags get a row."""

import numpy as np

from dropanchor_schemas.keys import InvalidKeyError, tag_from_key
from dropanchor_schemas.wire import Reason
from dropanchor_service.ingest.buffer import UnregisteredMessage
from dropanchor_service.ingest.decode import read_forms
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import PendingTags, SiteStore, Tag, TagTable
from dropanchor_service.store.pending_tags import Waiting, is_confirmed

_REFUSALS = {"refuse": Reason.TAG_UNKNOWN, "quarantine": Reason.TAG_QUARANTINED}


class Admission:
    """Tags that an operator has listed always get a row; others as the settings say.

    A row costs kilobytes and is never taken back, so strangers get one at once only while few rows belong to tags that
    were heard no more than once. Beyond that their first message waits until another one comes. Owned by one thread.
    """

    def __init__(self, settings: Settings, site: SiteStore, tags: TagTable, pending_tags: PendingTags) -> None:
        self._refusal = _REFUSALS.get(settings.unknown_tags)
        self._max_tags = settings.max_tags
        self._max_unconfirmed = settings.unproven_tags
        self._site = site
        self._tags = tags
        self._pending_tags = pending_tags
        self._unconfirmed = np.zeros(0, np.int64)  # rows of strangers who had not proven themselves

    def hear(self, stranger: UnregisteredMessage) -> Tag | Reason | None:
        """Who sent this, with a row; or why it is not used; None: it waits."""
        key, message = stranger[0], stranger[1:]
        try:
            name = tag_from_key(key)
        except InvalidKeyError:
            return Reason.KEY_INVALID
        found = self.by_name(name)
        if found is Reason.TAG_QUARANTINED:
            self._pending_tags.hear(name, message[2])
        return self._confirm(name, message) if found is Reason.TAG_UNPROVEN else found

    def by_name(self, name: str) -> Tag | Reason:
        """The tag of this name, registered when it may be without a confirmed, or why it may not."""
        tag = self._tags.find(name)
        if tag is not None:
            return tag
        if name in self._site.tags:
            return self._tags.register(name)
        if self._refusal is not None:
            return self._refusal
        if len(self._tags) >= self._max_tags:
            return Reason.TAGS_FULL
        if len(self._unconfirmed) >= self._max_unconfirmed:
            return Reason.TAG_UNPROVEN
        tag = self._tags.register(name)
        self._unconfirmed = np.append(self._unconfirmed, tag.row)
        return tag

    def waited(self, tag: Tag) -> list[Waiting]:
        """What came from this tag before it got its row, in order of arrival."""
        return self._pending_tags.take(tag.name)

    def take_expired(self) -> int:
        """Messages of tags that did not send another one, since the last call."""
        return self._pending_tags.take_gone()

    def review(self) -> None:
        """Rows whose tags have proven themselves make room for other strangers."""
        if len(self._unconfirmed) >= self._max_unconfirmed:
            counts = self._tags.counts(self._unconfirmed)
            confirmed = is_confirmed(counts["messages"], counts["first_heard_ns"], counts["last_heard_ns"])
            self._unconfirmed = self._unconfirmed[~(confirmed & counts["samples"].any(axis=1))]

    def register_listed(self) -> None:
        """A row for every tag that the operator has listed."""
        for name in self._site.tags:
            self._tags.register(name)

    def _confirm(self, name: str, message: Waiting) -> Tag | Reason | None:
        payload, encoding, arrival_ns = message
        for _, reason in read_forms([payload], [encoding]).rejected:
            return reason
        if self._pending_tags.hear(name, arrival_ns):
            return self._tags.register(name)
        return None if self._pending_tags.keep(name, message) else Reason.TAG_UNPROVEN
