"""What an overview of sites says about each: how many tags it has, in which states, and how many need a person."""

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.answers.care import care_of
from dropanchor_service.answers.columns import aged_poses
from dropanchor_service.answers.frames import STATES, published_states
from dropanchor_service.estimation.columns import Array


def summaries(sites: Sequence[Answers], wanted: Collection[str]) -> Iterator[Answer]:
    """Yield the `SiteSummary` of each wanted site. sites: all of the process, in the order of their indices."""
    now_ns = sites[0].now_ns()
    states = _states(sites, now_ns)
    offsets = sites[0].clock_offsets.clock_offsets(now_ns)
    for answers, counts in zip(sites, states.tolist(), strict=True):
        site, tags = answers.site.site, answers.tags.listed()
        if site.id not in wanted:
            continue
        yield {
            "site": site.id,
            "name": site.name,
            "georeference": None if site.georeference is None else site.georeference.model_dump(),
            "anchors": len(site.anchors),
            "tags": len(tags),
            "online": answers.tags.presence.count(),
            "states": {state: count for state, count in zip(STATES, counts, strict=True) if count},
            "needs_care": sum(bool(care_of(tag, answers.health, now_ns, offsets.get(tag.row))) for tag in tags),
        }


def _states(sites: Sequence[Answers], now_ns: int) -> Array:
    """Return how many tags are in which state now: a line for each site, a column for each state."""
    rows = sites[0].tags.rows
    poses = sites[0].latest.since()[1]
    aged = aged_poses(poses, rows.overdue_s(poses, now_ns))
    counts = np.zeros((len(sites), len(STATES)), np.int64)
    np.add.at(counts, (rows.sites(aged["row"]), published_states(aged["state"], aged["frame"])), 1)
    return counts
