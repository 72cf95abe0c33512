"""The anchors of all sites in one table, as the engine indexes them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import ANCHOR, Array
from dropanchor_service.settings.engine_columns import anchor_columns
from dropanchor_service.store import ServedSite

_NUMBER_BITS = 32  # of an anchor number


class Change(NamedTuple):
    """Whether an anchor of a site has moved, whether one has turned, and whether somebody has said where one is."""

    moved: bool
    turned: bool
    told: bool


class AnchorTable:
    """An index keeps its meaning for the life of the table. Owned by one thread.

    places: ANCHOR, of every anchor that a site has or had. sites: index of the site of each. With one site, an index is
    the one that its store gives the anchor.
    """

    def __init__(self) -> None:
        self._clear()

    def _clear(self) -> None:
        self.places = np.zeros(0, ANCHOR)
        self.sites = np.zeros(0, np.int32)
        self._told: dict[int, int] = {}  # by index of the site: how often somebody has said where an anchor is
        self._indices: dict[int, Array] = {}  # by index of the site: where its anchors are, in the order of its store
        self._own = np.full(1, -1, np.int32)  # index within its site of each anchor, and -1 for no anchor
        self._keys = np.zeros(0, np.int64)  # of the anchors that the sites have now: site and number, ascending
        self._of_keys = np.zeros(0, np.int32)  # their indices

    def follow(self, site: ServedSite) -> Change:
        """Take over the anchors of a site. Return what has changed of those that it had."""
        places, known = anchor_columns(site.store.anchors_by_index()), self._of(site.index)
        now, before = places[: len(known)], self.places[known]
        moved, turned = have_moved(now, before), _have_turned(now, before)
        turned |= moved & np.isfinite(now["facing"])  # where its azimuths placed a tag is no longer a place of the site
        self._append(np.full(len(places) - len(known), site.index, np.int32))
        self.places[self._of(site.index)] = places
        self._find_by_number(site)
        told = self._told.get(site.index, 0)
        self._told[site.index] = site.store.anchors_told
        return Change(bool(moved.any()), bool(turned.any()), told != site.store.anchors_told)

    def of_site(self, site: int) -> list[int]:
        """Return the indices of the anchors that a site has or had."""
        of_site: list[int] = self._of(site).tolist()
        return of_site

    def restore(self, sites: Sequence[int]) -> None:
        """Give the anchors of an earlier table the same indices. Every site has to be followed again.

        sites: index of the site of each anchor.
        """
        self._clear()
        self._append(np.array(sites, np.int32))

    def indices(self, sites: Array, numbers: Array) -> Array:
        """Return the index of each anchor, -1 for one that its site does not have. sites: indices. numbers: u32."""
        if not len(self._keys):
            return np.full(len(numbers), -1, np.int32)
        wanted = (sites.astype(np.int64) << _NUMBER_BITS) | numbers.astype(np.int64)
        place = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        indices: Array = np.where(self._keys[place] == wanted, self._of_keys[place], np.int32(-1))
        return indices

    def own_indices(self, indices: Array) -> Array:
        """Return the index within its site of each anchor, -1 for no anchor."""
        own: Array = self._own[indices]
        return own

    def _of(self, site: int) -> Array:
        return self._indices.get(site, np.zeros(0, np.int32))

    def _append(self, sites: Array) -> None:
        """Add anchors of these sites, whose places are not known yet."""
        begin, own = len(self.sites), np.zeros(len(sites), np.int32)
        for site in dict.fromkeys(sites.tolist()):
            new, known = np.flatnonzero(sites == site).astype(np.int32), self._of(site)
            own[new] = len(known) + np.arange(len(new))
            self._indices[site] = np.concatenate([known, begin + new])
        self.sites = np.concatenate([self.sites, sites])
        self.places = np.concatenate([self.places, np.zeros(len(sites), ANCHOR)])
        self._own = np.concatenate([self._own[:-1], own, self._own[-1:]])

    def _find_by_number(self, site: ServedSite) -> None:
        """Replace the keys of a site, which stand side by side."""
        first = site.index << _NUMBER_BITS
        found = sorted((anchor.number, site.store.anchor_index(anchor.number)) for anchor in site.store.site.anchors)
        known = [(first | number, self._of(site.index)[own]) for number, own in found if own is not None]
        begin, end = np.searchsorted(self._keys, [first, first + (1 << _NUMBER_BITS)])
        keys, indices = np.array([key for key, _ in known], np.int64), np.array([i for _, i in known], np.int32)
        self._keys = np.concatenate([self._keys[:begin], keys, self._keys[end:]])
        self._of_keys = np.concatenate([self._of_keys[:begin], indices, self._of_keys[end:]])


def have_moved(places: Array, before: Array) -> Array:
    """Return which of these ANCHOR are in other places than before."""
    moved: Array = np.any([places[axis] != before[axis] for axis in "xyz"], axis=0)
    return moved


def _have_turned(places: Array, before: Array) -> Array:
    """Return which of these ANCHOR face elsewhere, or see what is behind them in another way."""
    facing, earlier = places["facing"], before["facing"]
    same: Array = (facing == earlier) | (np.isnan(facing) & np.isnan(earlier))
    turned: Array = ~same | (places["mirrors"] != before["mirrors"])
    return turned
