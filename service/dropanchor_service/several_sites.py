"""What a service with several sites has, so far: access, and for each site its folder and its routes."""

from collections.abc import Callable, Sequence
from functools import partial
from threading import Event

from fastapi import FastAPI

from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.health import Ready
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.api.several_sites import create_app_of_sites
from dropanchor_service.api.site_routers import SharedParts
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.security.credentials import authenticator_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import Settings
from dropanchor_service.site_folders import SiteFolders
from dropanchor_service.store import Sites
from dropanchor_service.zenoh_io.endpoints import endpoints_of

ReceiveOfSite = Callable[[str, str, bytes, str], None]
"""Takes a payload in as if it had come over Zenoh: the ids of site and tag, the payload, its encoding."""


class SeveralSites:
    """The parts of a service with several sites. Creating it raises SettingsError."""

    def __init__(
        self,
        settings: Settings,
        credentials: SecurityFolder | None,
        sites: Sites,
        now_ns: Callable[[], int],
        metrics: Metrics,
    ) -> None:
        self._settings = settings
        self._credentials = credentials
        self._authenticator = authenticator_of(settings)
        self._sites = sites
        self._metrics = metrics
        self.folders = SiteFolders(settings, sites, now_ns, metrics)

    def app(
        self,
        answers: AnswersOfSites,
        ready: Ready,
        impaired: Callable[[], Sequence[str]],
        stopping: Event,
        receive: ReceiveOfSite,
        receive_health: ReceiveOfSite,
    ) -> FastAPI:
        """Return the application; see `create_app_of_sites`."""
        http = self._settings.http
        shared = SharedParts(
            stopping,
            endpoints_of(self._settings.zenoh, self._credentials),
            self._credentials,
            self._authenticator,
            RateLimiter(http.requests_per_s, http.burst),
            http.cors_origins,
            self.folders.basemap,
        )
        parts = [
            SiteParts(
                of_site,
                partial(receive, site.id),
                partial(receive_health, site.id),
                plans=folder.plans,
                recorder=folder.recorder,
                max_tags=site.quota.max_tags,
            )
            for site, of_site, folder in zip(self._sites, answers, self.folders.all, strict=True)
        ]
        return create_app_of_sites(parts, shared, ready=ready, impaired=impaired, registry=self._metrics.registry)
