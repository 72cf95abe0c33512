"""Who owns which bucket, as one event loop knows it."""

import asyncio
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from dropanchor_schemas.epochs import EpochFence

HOLD_S = 1.5
"""How long a request waits for a successor after its bucket was last served. A planned move takes 0.4 s."""


@dataclass(frozen=True)
class Owner:
    """name: empty when nobody owns the bucket. address: of its REST interface; empty when it is not known."""

    bucket: str
    epoch: int
    name: str
    address: str


class Owners:
    """The newest owner of each bucket. Not thread-safe. An epoch never falls: whoever has a lower one is ignored."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._owners: dict[str, Owner] = {}
        self._fence = EpochFence()
        self._followed: dict[Owner, asyncio.Future[None]] = {}
        self._served_s: dict[str, float] = {}

    @property
    def buckets(self) -> list[str]:
        return sorted(self._owners)

    @property
    def addresses(self) -> set[str]:
        return {owner.address for owner in self._owners.values()}

    def of(self, bucket: str) -> Owner | None:
        """Return the owner of a bucket. None: there is no such bucket."""
        return self._owners.get(bucket)

    def without_owner(self) -> list[str]:
        return [bucket for bucket in self.buckets if not self._owners[bucket].address]

    def take(self, found: Iterable[Owner]) -> None:
        """Take the owners that the table of leases names now."""
        listed = {owner.bucket: owner for owner in found}
        for bucket in self._owners.keys() - listed.keys():
            del self._owners[bucket]
        for bucket, owner in listed.items():
            if self._fence.accepts(bucket, owner.epoch):
                former = self._owners.get(bucket)
                self._owners[bucket] = owner
                if former is not None and former.epoch < owner.epoch:
                    self._served_s[bucket] = self._now_s()
        self._tell_the_followed()

    def accepted(self, owner: Owner, epoch: int) -> Owner | None:
        """Return who gave an answer with this epoch; None if it is a former owner, whose answer must not be used.

        An owner that has started again has a higher epoch than the table said.
        """
        if not self._fence.accepts(owner.bucket, epoch):
            return None
        if epoch > owner.epoch:
            owner = replace(owner, epoch=epoch)
            self._owners[owner.bucket] = owner
            self._tell_the_followed()
        self._served_s[owner.bucket] = self._now_s()
        return owner

    def is_worth_waiting(self, bucket: str) -> bool:
        """Return whether the bucket was served, or changed its owner, a moment ago."""
        return self._now_s() - self._served_s.get(bucket, float("-inf")) < HOLD_S

    def followed(self, owner: Owner) -> "asyncio.Future[None]":
        """Return a future that is done once the bucket has an owner with a higher epoch."""
        future = self._followed.setdefault(owner, asyncio.get_running_loop().create_future())
        self._tell_the_followed()
        return future

    def _tell_the_followed(self) -> None:
        for owner in [one for one in self._followed if not self._fence.accepts(one.bucket, one.epoch)]:
            self._followed.pop(owner).set_result(None)
