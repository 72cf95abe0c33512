"""The sites that a process serves: what each site has for itself, and the rows that their tags share."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from dropanchor_schemas import keys
from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_schemas.site import Site
from dropanchor_schemas.wire import Reason
from dropanchor_service.settings.buckets import common_bucket
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store.health import HealthTable
from dropanchor_service.store.pending_tags import MAX_BYTES, PendingTags
from dropanchor_service.store.rows import Rows, Tag
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable

_REFUSALS = {"refuse": Reason.TAG_UNKNOWN, "quarantine": Reason.TAG_QUARANTINED}
LEAST_PENDING_BYTES = 2**16  # for the messages of pending tags of a site, however many sites there are


@dataclass(frozen=True)
class ServedSite:
    """What one site has for itself. index: of the site in this process. quota: which tags it admits, and how many."""

    index: int
    store: SiteStore
    tags: TagTable
    pending_tags: PendingTags
    health: HealthTable
    quota: Quota

    @property
    def id(self) -> str:
        return self.store.site.id

    def refusal_of(self, name: str) -> Reason | None:
        """Return why the site refuses a tag that it does not list, None if it does not."""
        tag = self.tags.find(name)
        if name in self.store.tags or (tag is not None and not self.tags.is_deleted(tag.row)):
            return None
        return _REFUSALS.get(self.quota.unknown_tags)


class Sites:
    """All sites of a process, which are known at its start. `take_changed` is for one thread, the rest for any."""

    def __init__(self, sites: Sequence[tuple[SiteStore, Quota]]) -> None:
        self.rows = Rows()
        paths = ["/api/v1"] if len(sites) == 1 else [f"/api/v1/sites/{_chunk(store)}" for store, _ in sites]
        self._pending_bytes = max(MAX_BYTES // len(sites), LEAST_PENDING_BYTES)
        self._served = len(sites)
        self._sites: list[ServedSite] = []
        self._changed: deque[int] = deque()
        for (store, quota), path in zip(sites, paths, strict=True):
            self._add(store, quota, path)
        self._by_id = {site.id: site for site in self._sites}
        self._chunks = {_chunk(site.store) for site in self._sites}
        self._bucket = common_bucket(self._by_id)

    def _add(self, store: SiteStore, quota: Quota, path: str) -> ServedSite:
        index = len(self._sites)
        tags, pending = TagTable(self.rows, index, path), PendingTags(quota.max_tags, self._pending_bytes)
        site = ServedSite(index, store, tags, pending, HealthTable(), quota)
        self._sites.append(site)
        self._changed.append(index)
        store.on_change.append(partial(self._changed.append, index))
        return site

    def add_former(self, name: str) -> ServedSite:
        """Return a place for the rows of a site that is no longer served, in case it is served again later.

        Its messages are dropped and nothing shows its tags. Call this before the first message.
        """
        return self._add(SiteStore(Site(id=name), {}), Quota(), "/api/v1")

    def __len__(self) -> int:
        return self._served

    def __iter__(self) -> Iterator[ServedSite]:
        return iter(self._sites[: self._served])

    def __getitem__(self, index: int) -> ServedSite:
        return self._sites[index]

    @property
    def with_former(self) -> Sequence[ServedSite]:
        """The sites, and then those that are no longer served."""
        return self._sites

    @property
    def only(self) -> ServedSite | None:
        """The site, if there is only one."""
        return self._sites[0] if self._served == 1 else None

    def is_served(self, tag: Tag) -> bool:
        """Return whether the site of a tag is served."""
        return tag.site < self._served

    def find(self, site: str) -> ServedSite | None:
        """Return the site with this id, or None."""
        return self._by_id.get(site)

    def max_tags(self, site: str) -> int:
        """Return how many tags the site with this id admits. Raises KeyError."""
        return self._by_id[site].quota.max_tags

    def of_row(self, row: int) -> ServedSite:
        """Return the site of the tag in this row."""
        return self._sites[self.rows.at(row).site]

    def of_key(self, key: str) -> tuple[ServedSite, str]:
        """Return the site and the name of the tag that a key names. Raises InvalidKeyError, also for other sites."""
        name, tag = keys.site_and_tag_from_key(key)
        site = self._by_id.get(name)
        if site is None:
            raise InvalidKeyError(f"{key!r} is of a site that is not served here")
        return site, tag

    def tag_of(self, key: str) -> Tag | None:
        """Return the tag that a key names, None if it has no row. Raises InvalidKeyError, also for other sites."""
        site, tag = self.of_key(key)
        return site.tags.find(tag)

    def all_tags(self, leaf: str) -> str:
        """Return the key expression of `leaf` of every tag of these sites.

        Several sites also get keys of others, but not of other buckets if all have one.
        """
        return keys.all_sites(leaf, self._bucket) if self.only is None else keys.all_tags(self.only.id, leaf)

    def serves(self, key: str) -> bool:
        """Return whether a key that `all_tags` matches is of one of these sites."""
        return self.only is not None or key.split("/", 3)[2] in self._chunks

    def samples_key(self, row: int) -> str:
        """Return the key of the samples of the tag in this row."""
        return keys.samples_key(self.of_row(row).id, self.rows.at(row).name)

    def take_changed(self) -> list[ServedSite]:
        """Return the sites that have changed since the last call; at first all of them."""
        indices = [self._changed.popleft() for _ in range(len(self._changed))]
        return [self._sites[index] for index in dict.fromkeys(indices)]


def _chunk(store: SiteStore) -> str:
    return keys.chunk_from_id(store.site.id)
