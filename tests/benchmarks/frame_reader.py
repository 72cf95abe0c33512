"""Read the frames of all sites as an application does, and note when news stop and whose poses were accepted."""

import json
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from threading import Lock
from typing import Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.epochs import EpochFence

ROUNDING_NS = 2_000_000  # of the ages in a frame


class FrameReader:
    """Reads frames, and drops those of former owners.

    of_other_sites: frames that were accepted after one of a later owner of the same bucket, which was of another site.
    backwards: accepted frames whose newest pose is older than that of the frame before it.
    """

    def __init__(self, sites: Iterable[str]) -> None:
        self.of_other_sites = self.backwards = 0
        self._dropped = self._accepted = 0  # frames of former owners of a site
        self._sites = list(sites)
        self._fence = EpochFence()
        self._newest_ns: dict[str, int] = defaultdict(int)  # by site
        self._highest: dict[str, int] = defaultdict(int)  # epoch of a frame, by bucket and by site
        self._news_s: dict[str, list[float]] = defaultdict(list)  # by site
        self._lock = Lock()

    @contextmanager
    def subscribed(self, session: zenoh.Session) -> Iterator[Self]:
        subscriber = session.declare_subscriber(keys.poses_of_all_sites(), self._on_frame)
        yield self
        subscriber.undeclare()

    @property
    def former(self) -> tuple[int, int]:
        """How many frames of former owners of a site were dropped so far, and how many were accepted."""
        with self._lock:
            return self._dropped, self._accepted

    def are_current(self, since_s: float) -> bool:
        """Return whether every site has had news since then."""
        with self._lock:
            return all(self._news_s[site] and self._news_s[site][-1] > since_s for site in self._sites)

    def silences_s(self, since_s: float) -> dict[str, float]:
        """Return the longest time without news of any site of a bucket, by bucket."""
        longest: dict[str, float] = defaultdict(float)
        with self._lock:
            for site in self._sites:
                times = [at_s for at_s in self._news_s[site] if at_s > since_s - 0.5]
                gap_s = max(later - earlier for earlier, later in pairwise(times))
                longest[bucket_of(site)] = max(longest[bucket_of(site)], gap_s)
        return longest

    def _on_frame(self, message: zenoh.Sample) -> None:
        site, frame = str(message.key_expr).split("/")[2], json.loads(message.payload.to_bytes())
        newest_ns = frame["t_ns"] - round(min(frame["age_s"], default=0.0) * 1e9)
        with self._lock:
            if self._accepts(site, frame["epoch"]):
                self._note(site, newest_ns)

    def _accepts(self, site: str, epoch: int) -> bool:
        accepts, bucket = self._fence.accepts(site, epoch), bucket_of(site)
        is_former = epoch < self._highest[site]
        self._dropped += not accepts
        self._accepted += accepts and is_former
        self.of_other_sites += accepts and epoch < self._highest[bucket]
        for each in (site, bucket):
            self._highest[each] = max(self._highest[each], epoch)
        return accepts

    def _note(self, site: str, newest_ns: int) -> None:
        before_ns = self._newest_ns[site]
        self.backwards += newest_ns < before_ns - ROUNDING_NS
        if newest_ns > before_ns + ROUNDING_NS:
            self._newest_ns[site] = newest_ns
            self._news_s[site].append(time.monotonic())


def bucket_of(site: str) -> str:
    return site.partition(".")[0]
