"""Decide which tags get a row."""

import numpy as np

from dropanchor_schemas.keys import InvalidKeyError, tag_from_key
from dropanchor_schemas.wire import Reason
from dropanchor_service.ingest.buffer import UnregisteredMessage
from dropanchor_service.ingest.decode import read_forms
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import PendingTags, SiteStore, Tag, TagTable
from dropanchor_service.store.pending_tags import BufferedMessage, is_confirmed

_REFUSALS = {"refuse": Reason.TAG_UNKNOWN, "quarantine": Reason.TAG_QUARANTINED}


class Admission:
    """Give rows to the tags that an operator has listed, and to other tags as the settings say.

    A row takes kilobytes and is never freed. An unlisted tag therefore gets a row with its first message only while few
    rows belong to unconfirmed tags, which have sent one message. Otherwise its first message is kept until the second
    arrives. Owned by one thread.
    """

    def __init__(self, settings: Settings, site: SiteStore, tags: TagTable, pending_tags: PendingTags) -> None:
        self._refusal = _REFUSALS.get(settings.unknown_tags)
        self._max_tags = settings.max_tags
        self._max_unconfirmed = settings.unproven_tags
        self._site = site
        self._tags = tags
        self._pending_tags = pending_tags
        self._unconfirmed = np.zeros(0, np.int64)  # rows of unlisted tags that sent one message so far

    def admit_message(self, unregistered: UnregisteredMessage) -> Tag | Reason | None:
        """Return the tag that sent a message, with a row, or why it is rejected; None when the message is kept."""
        key, message = unregistered[0], unregistered[1:]
        try:
            name = tag_from_key(key)
        except InvalidKeyError:
            return Reason.KEY_INVALID
        found = self.admit(name)
        if found is Reason.TAG_QUARANTINED:
            self._pending_tags.on_message(name, message[2])
        return self._confirm(name, message) if found is Reason.TAG_UNPROVEN else found

    def admit(self, name: str) -> Tag | Reason:
        """Return the tag with this name, registering it if it needs no confirmation, or why it gets no row.

        A deleted tag needs what an unknown tag needs, except room: it still has its row.
        """
        tag = self._tags.find(name)
        if tag is not None and not self._tags.is_deleted(tag.row):
            return tag
        if name in self._site.tags:
            return self._tags.register(name)
        if self._refusal is not None:
            return self._refusal
        if tag is not None:
            return self._tags.register(name)
        if len(self._tags) >= self._max_tags:
            return Reason.TAGS_FULL
        if len(self._unconfirmed) >= self._max_unconfirmed:
            return Reason.TAG_UNPROVEN
        tag = self._tags.register(name)
        self._unconfirmed = np.append(self._unconfirmed, tag.row)
        return tag

    def take_kept(self, tag: Tag) -> list[BufferedMessage]:
        """Take out the messages that were kept until this tag got its row, in order of arrival."""
        return self._pending_tags.take(tag.name)

    def take_expired(self) -> int:
        """Return how many kept messages were dropped since the last call, because no second one arrived."""
        return self._pending_tags.take_evicted()

    def review(self) -> None:
        """Stop counting tags as unconfirmed once they have sent enough, so that other unlisted tags get rows."""
        if len(self._unconfirmed) >= self._max_unconfirmed:
            counts = self._tags.counts(self._unconfirmed)
            confirmed = is_confirmed(counts["messages"], counts["first_heard_ns"], counts["last_heard_ns"])
            self._unconfirmed = self._unconfirmed[~(confirmed & counts["samples"].any(axis=1))]

    def register_listed(self) -> None:
        """Give a row to every tag that the operator has listed."""
        for name in self._site.tags:
            self._tags.register(name)

    def _confirm(self, name: str, message: BufferedMessage) -> Tag | Reason | None:
        payload, encoding, arrival_ns = message
        for _, reason in read_forms([payload], [encoding]).rejected:
            return reason
        if self._pending_tags.on_message(name, arrival_ns):
            return self._tags.register(name)
        return None if self._pending_tags.buffer(name, message) else Reason.TAG_UNPROVEN
