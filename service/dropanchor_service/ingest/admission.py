"""Decide which tags get a row."""

import numpy as np

from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.buffer import UnregisteredMessage
from dropanchor_service.ingest.decode import read_forms
from dropanchor_service.store import ServedSite, Sites, Tag
from dropanchor_service.store.pending_tags import BufferedMessage, is_confirmed


class Admission:
    """Give rows to the tags that an operator has listed, and to other tags as the quota of their site says.

    A row takes kilobytes and is never freed. An unlisted tag therefore gets a row with its first message only while few
    rows of its site belong to unconfirmed tags, which have sent one message. Otherwise its first message is kept until
    the second arrives. Owned by one thread.
    """

    def __init__(self, sites: Sites) -> None:
        self._sites = sites
        self._unconfirmed: dict[int, Array] = {}  # by site: rows of unlisted tags that sent one message so far
        self._full: set[int] = set()  # sites with as many unconfirmed tags as they may have
        self._expired = 0

    def admit_message(self, unregistered: UnregisteredMessage) -> Tag | Reason | None:
        """Return the tag that sent a message, with a row, or why it is rejected; None when the message is kept."""
        key, message = unregistered[0], unregistered[1:]
        try:
            site, name = self._sites.of_key(key)
        except InvalidKeyError:
            return Reason.KEY_INVALID
        found = self.admit(site, name)
        if found is Reason.TAG_QUARANTINED:
            self._count_pending(site, name, message[2])
        return self._confirm(site, name, message) if found is Reason.TAG_UNCONFIRMED else found

    def admit(self, site: ServedSite, name: str) -> Tag | Reason:
        """Return the tag with this name, registering it if it needs no confirmation, or why it gets no row.

        A deleted tag needs what an unknown tag needs, except room: it still has its row.
        """
        tag, quota = site.tags.find(name), site.quota
        if tag is not None and not site.tags.is_deleted(tag.row):
            return tag
        if name in site.store.tags:
            return site.tags.register(name)
        if (refusal := site.refusal_of(name)) is not None:
            return refusal
        if tag is not None:
            return site.tags.register(name)
        if len(site.tags) >= quota.max_tags:
            return Reason.TAGS_FULL
        if len(self._unconfirmed_of(site)) >= quota.max_unconfirmed_tags:
            return Reason.TAG_UNCONFIRMED
        tag = site.tags.register(name)
        self._set_unconfirmed(site, np.append(self._unconfirmed_of(site), tag.row))
        return tag

    def take_kept(self, tag: Tag) -> list[BufferedMessage]:
        """Take out the messages that were kept until this tag got its row, in order of arrival."""
        return self._sites[tag.site].pending_tags.take(tag.name)

    def take_expired(self) -> int:
        """Return how many kept messages were dropped since the last call, because no second one arrived."""
        expired, self._expired = self._expired, 0
        return expired

    def review(self) -> None:
        """Stop counting tags as unconfirmed once they have sent enough, so that other unlisted tags get rows."""
        for index in tuple(self._full):
            rows = self._unconfirmed[index]
            counts = self._sites.rows.counts(rows)
            confirmed = is_confirmed(counts["messages"], counts["first_heard_ns"], counts["last_heard_ns"])
            self._set_unconfirmed(self._sites[index], rows[~(confirmed & counts["samples"].any(axis=1))])

    def register_listed(self, site: ServedSite) -> None:
        """Give a row to every tag that the operator of a site has listed."""
        for name in site.store.tags:
            site.tags.register(name)

    def _confirm(self, site: ServedSite, name: str, message: BufferedMessage) -> Tag | Reason | None:
        payload, encoding, arrival_ns = message
        for _, reason in read_forms([payload], [encoding]).rejected:
            return reason
        if self._count_pending(site, name, arrival_ns):
            return site.tags.register(name)
        return None if site.pending_tags.buffer(name, message) else Reason.TAG_UNCONFIRMED

    def _count_pending(self, site: ServedSite, name: str, arrival_ns: int) -> bool:
        """Count a message of a pending tag. Return whether its messages so far confirm the tag."""
        confirmed = site.pending_tags.on_message(name, arrival_ns)
        self._expired += site.pending_tags.take_evicted()
        return confirmed

    def _unconfirmed_of(self, site: ServedSite) -> Array:
        return self._unconfirmed.get(site.index, np.zeros(0, np.int64))

    def _set_unconfirmed(self, site: ServedSite, rows: Array) -> None:
        self._unconfirmed[site.index] = rows
        if len(rows) >= site.quota.max_unconfirmed_tags:
            self._full.add(site.index)
        else:
            self._full.discard(site.index)
