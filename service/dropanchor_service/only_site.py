"""What works for one site only, so far: history, recordings, plans, base map, zones, events and their routes."""

from collections.abc import Callable, Sequence
from threading import Event

from fastapi import FastAPI

from dropanchor_service.answers.answers import Answers
from dropanchor_service.api import create_app
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.health import Ready
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence import Persistence, open_database
from dropanchor_service.phones.intake import Receive
from dropanchor_service.security.credentials import authenticator_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import LatestPoses, ServedSite
from dropanchor_service.zenoh_io.endpoints import endpoints_of
from dropanchor_service.zone_events import ZoneEvents


class OnlySite:
    """The parts of a service with one site that a service with several sites lacks.

    Creating it raises SettingsError.
    """

    def __init__(
        self,
        settings: Settings,
        credentials: SecurityFolder | None,
        site: ServedSite,
        latest: LatestPoses,
        now_ns: Callable[[], int],
        metrics: Metrics,
    ) -> None:
        self._settings = settings
        self._credentials = credentials
        self._authenticator = authenticator_of(settings)
        self._metrics = metrics
        database = open_database(settings, now_ns)
        self.persistence = Persistence(settings, site.tags, site.store, now_ns, metrics, database)
        self.zone_events = ZoneEvents(settings, site.store, site.tags, latest, site.health, now_ns, metrics)

    def problems(self) -> Sequence[str]:
        """Return what does not work although the service can do its main work."""
        return [*self.persistence.problems(), *self.zone_events.problems()]

    def app(
        self,
        answers: Answers,
        ready: Ready,
        impaired: Callable[[], Sequence[str]],
        stopping: Event,
        receive: Receive,
        receive_health: Receive,
    ) -> FastAPI:
        """Return the application with all routes; see `create_app`."""
        settings = self._settings
        return create_app(
            answers,
            ready=ready,
            impaired=impaired,
            recorder=self.persistence.recorder,
            events=self.zone_events.parts,
            plans=self.persistence.plans,
            registry=self._metrics.registry,
            stopping=stopping,
            receive=receive,
            receive_health=receive_health,
            max_tags=settings.max_tags,
            endpoints=endpoints_of(settings.zenoh, self._credentials),
            credentials=self._credentials,
            authenticator=self._authenticator,
            rate_limiter=RateLimiter(settings.http.requests_per_s, settings.http.burst),
            cors_origins=settings.http.cors_origins,
            omlox=self.persistence.omlox,
            basemap=self.persistence.basemap,
        )
