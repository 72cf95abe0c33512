"""The answers of every site that a process serves."""

from collections.abc import Callable, Iterator, Sequence

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import Answers
from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.settings.buckets import common_bucket
from dropanchor_service.store import LatestPoses, Sites
from dropanchor_service.store.clock_offsets import ClockOffsets


class AnswersOfSites:
    """The answers of each site. only: those of the only site, or None. bucket: of all sites, or None.

    answers: in the order of the sites' indices. Their poses are in one `LatestPoses`.
    """

    def __init__(self, answers: Sequence[Answers]) -> None:
        self._answers = answers
        self._by_id = {one.site.site.id: one for one in answers}
        self._by_chunk = {keys.chunk_from_id(site): one for site, one in self._by_id.items()}
        self.only = answers[0] if len(answers) == 1 else None
        self.bucket = common_bucket(self._by_id)
        self.latest = answers[0].latest

    def __len__(self) -> int:
        return len(self._answers)

    def __iter__(self) -> Iterator[Answers]:
        return iter(self._answers)

    def find(self, site: str) -> Answers | None:
        """Return the answers of the site with this id, or None."""
        return self._by_id.get(site)

    def matching(self, key_expr: str) -> Sequence[Answers]:
        """Return those of the sites that a key expression may name: one, none, or all for a pattern."""
        chunk = key_expr.split("/")[2]
        if "*" in chunk or "$" in chunk:
            return self._answers
        found = self._by_chunk.get(chunk)
        return [] if found is None else [found]

    def divided(self, poses: Array) -> Iterator[tuple[Answers, Array]]:
        """Yield POSE of rows of several sites by site, with the answers of the site."""
        if self.only is not None:
            yield self.only, poses
            return
        for site, of_site in self._answers[0].tags.rows.by_site(poses):
            yield self._answers[site], of_site


def answers_of_sites(
    sites: Sites,
    latest: LatestPoses,
    now_ns: Callable[[], int],
    tracks: Sequence[Tracks | None],
    clock_offsets: ClockOffsets,
) -> AnswersOfSites:
    """Return the answers of these sites; see `Answers`. tracks: of each site."""
    return AnswersOfSites(
        [
            Answers(site.store, site.tags, latest, now_ns, of_site, site.pending_tags, site.health, clock_offsets)
            for site, of_site in zip(sites, tracks, strict=True)
        ]
    )
