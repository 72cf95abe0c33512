"""What all sites have besides the ingest: access, and for each its folder, its zones and events, and its routes."""

from collections.abc import Callable, Sequence
from functools import partial
from threading import Event

from fastapi import FastAPI

from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.api.app import create_app
from dropanchor_service.api.http.borders import border_of
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.health import Ready
from dropanchor_service.api.routes.shared_parts import SharedParts
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.api.simulated_tags import SimulatedTags
from dropanchor_service.blackbox.box import BlackBox
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site_folders import SiteFolders
from dropanchor_service.persistence.zone_events import ZoneEvents
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security.credentials import authenticator_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import LatestPoses, Sites
from dropanchor_service.zenoh_io.endpoints import endpoints_of

ReceiveOfSite = Callable[[str, str, bytes, str], None]
"""Takes a payload in as if it had come over Zenoh: the ids of site and tag, the payload, its encoding."""


class Serving:
    """The parts of a service with one or several sites. Creating it raises SettingsError."""

    def __init__(
        self,
        settings: Settings,
        credentials: SecurityFolder | None,
        sites: Sites,
        latest: LatestPoses,
        now_ns: Callable[[], int],
        metrics: Metrics,
        recovery: Recovery,
    ) -> None:
        self._settings = settings
        self._credentials = credentials
        self._authenticator = authenticator_of(settings, recovery)
        self.border = border_of(settings.http, credentials)
        self.simulated = SimulatedTags()
        self._sites = sites
        self._metrics = metrics
        self.folders = SiteFolders(settings, sites, now_ns, metrics, recovery)
        self.zone_events = ZoneEvents(settings, sites, latest, now_ns, metrics, recovery)
        for site, folder, events in zip(sites, self.folders.all, self.zone_events.parts, strict=True):
            events.note_changes(site.store, folder.plans, folder.omlox)

    def problems(self) -> Sequence[str]:
        """Return what does not work although the service can do its main work."""
        return [*self.folders.problems(), *self.zone_events.problems()]

    def stop(self) -> None:
        """End other processes: those that read plans, and simulated tags."""
        self.folders.stop_reading()
        self.simulated.stop()

    def app(
        self,
        answers: AnswersOfSites,
        ready: Ready,
        impaired: Callable[[], Sequence[str]],
        stopping: Event,
        receive: ReceiveOfSite,
        receive_health: ReceiveOfSite,
        url: str,
        box: BlackBox | None,
    ) -> FastAPI:
        """Return the application; see `create_app`. url: where the service listens."""
        parts = [
            SiteParts(
                of_site,
                partial(receive, site.id),
                partial(receive_health, site.id),
                plans=folder.plans,
                events=events,
                refusal_of=site.refusal_of,
                recorder=folder.recorder,
                max_tags=site.quota.max_tags,
                omlox=folder.omlox,
                box=box,
            )
            for site, of_site, folder, events in zip(
                self._sites, answers, self.folders.all, self.zone_events.parts, strict=True
            )
        ]
        return create_app(
            parts, self._shared(stopping, url), ready=ready, impaired=impaired, registry=self._metrics.registry
        )

    def _shared(self, stopping: Event, url: str) -> SharedParts:
        http = self._settings.http
        return SharedParts(
            stopping,
            endpoints_of(self._settings.zenoh, self._credentials),
            self._credentials,
            self._authenticator,
            RateLimiter(http.requests_per_s, http.burst),
            self.border,
            self.folders.basemap,
            url=url,
            simulated=self.simulated,
        )
