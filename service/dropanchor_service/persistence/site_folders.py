"""What the sites have on disk: each its floor plans, history and recordings, and all the base map."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from threading import Lock
from typing import Self

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.metrics.persistence import HistoryMetrics, RecordingMetrics
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site import Persistence, open_basemap, open_database, retention_of, settings_of
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import Sites

MOST_NAMED = 3  # sites that share a problem, such as a database that is away


class SiteFolders:
    """The `Persistence` of each site, in the order of their indices. They write while this context is open.

    Creating it raises SettingsError.
    """

    def __init__(
        self,
        settings: Settings,
        sites: Sites,
        now_ns: Callable[[], int],
        metrics: Metrics,
        recovery: Recovery | None = None,
    ) -> None:
        self._sites = sites
        self._opened = ExitStack()
        self._database = database = open_database(settings, now_ns)
        self.all = [
            Persistence(settings_of(settings, site.id), site.tags, site.store, now_ns, database, recovery)
            for site in sites
        ]
        self._has_history = any(one.tracks is not None for one in self.all)
        self._decimation = retention_of(settings.history).decimation()
        self.basemap = open_basemap(settings, [site.store for site in sites])
        if tracks := [one.tracks for one in self.all if one.tracks is not None]:
            metrics.register(HistoryMetrics(*tracks))
        self._recording: set[int] = set()  # indices of the sites that record now
        self._following = Lock()
        for index, one in enumerate(self.all):
            if one.recorder is not None:
                one.recorder.on_change.append(partial(self._follow, index, one.recorder))
        if recorders := [one.recorder for one in self.all if one.recorder is not None]:
            metrics.register(RecordingMetrics(*recorders))

    def __enter__(self) -> Self:
        with self._opened:
            if self.basemap is not None:
                self._opened.callback(self.basemap.file.close)
            for one in self.all:
                self._opened.enter_context(one)
            self._opened = self._opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def stop_reading(self) -> None:
        """Let no request wait for the database any longer."""
        if self._database is not None:
            self._database.stop_reading()

    def problems(self) -> Sequence[str]:
        """Return what cannot be written or read, with several sites with their names."""
        if len(self.all) == 1:
            return self.all[0].problems()
        of_problem: dict[str, list[str]] = {}
        for site, one in zip(self._sites, self.all, strict=True):
            for problem in one.problems():
                of_problem.setdefault(problem, []).append(site.id)
        return [f"{_named(sites)}: {problem}" for problem, sites in of_problem.items()]

    @property
    def observers(self) -> Observers:
        """The observers that pass messages and poses of the ingest to the site that they are of."""
        to_sites = [one.observers for one in self.all]
        if len(to_sites) == 1:
            return to_sites[0]

        def on_messages(messages: Sequence[tuple[int, bytes, str, int]]) -> None:
            if not self._recording:
                return
            of_sites: dict[int, list[tuple[int, bytes, str, int]]] = {}
            for message in messages:
                of_sites.setdefault(self._sites.rows.at(message[0]).site, []).append(message)
            for site, of_site in of_sites.items():
                to_sites[site].messages(of_site)

        def on_poses(poses: Array) -> None:
            self._keep(poses)
            if self._recording:
                for site, of_site in self._sites.rows.by_site(poses):
                    if (recorder := self.all[site].recorder) is not None:
                        recorder.record_poses(of_site)

        return Observers(on_messages, on_poses)

    def _keep(self, poses: Array) -> None:
        """Pass poses to the histories. They are decimated together: that costs as much for one site as for many."""
        if not self._has_history:
            return
        kept = self._decimation.select(poses)
        for site, of_site in self._sites.rows.by_site(kept) if len(kept) else ():
            if (tracks := self.all[site].tracks) is not None:
                tracks.keep(of_site)

    def _follow(self, index: int, recorder: Recorder) -> None:
        """Note whether a site records. A turn of the ingest visits no site to find out."""
        with self._following:
            if recorder.running is None:
                self._recording.discard(index)
            else:
                self._recording.add(index)


def _named(sites: Sequence[str]) -> str:
    """Return the names of the sites that share a problem, of many the first ones."""
    first = ", ".join(sites[:MOST_NAMED])
    more = f" and {len(sites) - MOST_NAMED} more" if len(sites) > MOST_NAMED else ""
    return f"site{'s' if len(sites) > 1 else ''} {first}{more}"
