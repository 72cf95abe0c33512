"""The routes that each site has, below its id, and an only site also without it."""

from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

from fastapi import APIRouter

from dropanchor_service.api.http.borders import ANY_HOST, Border
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.access import access_router
from dropanchor_service.api.routes.api_keys import api_keys_router
from dropanchor_service.api.routes.basemap import basemap_router
from dropanchor_service.api.routes.connect import connect_router
from dropanchor_service.api.routes.coverage import coverage_router
from dropanchor_service.api.routes.destinations import destinations_router
from dropanchor_service.api.routes.events import events_router
from dropanchor_service.api.routes.figures import figures_router
from dropanchor_service.api.routes.heat_map import heat_map_router
from dropanchor_service.api.routes.history import history_router
from dropanchor_service.api.routes.ingest import ingest_router
from dropanchor_service.api.routes.ingest_health import ingest_health_router
from dropanchor_service.api.routes.ingest_phyphox import ingest_phyphox_router
from dropanchor_service.api.routes.ingest_stream import ingest_stream_router
from dropanchor_service.api.routes.north import north_router
from dropanchor_service.api.routes.plan_images import plan_images_router
from dropanchor_service.api.routes.plans import plans_router
from dropanchor_service.api.routes.poses import poses_router
from dropanchor_service.api.routes.receiver_networks import receiver_networks_router
from dropanchor_service.api.routes.recordings import recordings_router
from dropanchor_service.api.routes.remote_settings import remote_settings_router
from dropanchor_service.api.routes.shares import shares_router
from dropanchor_service.api.routes.site import site_router
from dropanchor_service.api.routes.site_of_request import SiteOfRequest
from dropanchor_service.api.routes.stream import stream_router
from dropanchor_service.api.routes.tags import tag_router, tags_router
from dropanchor_service.api.routes.track import track_router
from dropanchor_service.api.routes.track_file import track_file_router
from dropanchor_service.api.routes.tracks import tracks_router
from dropanchor_service.api.routes.zone_occupancy import zone_occupancy_router
from dropanchor_service.api.routes.zones import zones_router
from dropanchor_service.security.api_keys import api_keys_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.identity import Authenticator
from dropanchor_service.security.share_links import share_links_of

if TYPE_CHECKING:
    from dropanchor_service.basemap.basemap import ServedBasemap  # an extra


@dataclass(frozen=True)
class SharedParts:
    """What the routes of all sites share.

    stopping: ends the streams when set. endpoints: those of the Zenoh router, as configured. credentials: those of the
    tags; None when they need none. authenticator: None when every client may do everything. rate_limiter: limits the
    requests of each client; None for no limit. border: which hosts and web pages may use the interface. basemap: None
    when there is none.
    """

    stopping: Event
    endpoints: tuple[str, ...] = ()
    credentials: SecurityFolder | None = None
    authenticator: Authenticator | None = None
    rate_limiter: RateLimiter | None = None
    border: Border = ANY_HOST
    basemap: "ServedBasemap | None" = None


def ingest_routers(site_of: SiteOfRequest, shared: SharedParts) -> tuple[APIRouter, ...]:
    """Return the routes that take samples. The key of a tag says of which site it is."""
    return (
        ingest_router(site_of),
        ingest_phyphox_router(site_of),
        ingest_health_router(site_of),
        ingest_stream_router(site_of, shared.stopping, shared.authenticator, shared.rate_limiter),
    )


def site_routers(site_of: SiteOfRequest, shared: SharedParts) -> tuple[APIRouter, ...]:
    """Return the routes of the site that `site_of` finds."""
    return (
        poses_router(site_of),
        tags_router(site_of),
        tag_router(site_of),
        site_router(site_of),
        north_router(site_of),
        remote_settings_router(site_of),
        track_router(site_of),
        track_file_router(site_of),
        tracks_router(site_of),
        coverage_router(site_of),
        heat_map_router(site_of),
        history_router(site_of),
        stream_router(site_of, shared.stopping),
        access_router(site_of),
        connect_router(site_of, shared.endpoints, shared.credentials),
        *ingest_routers(site_of, shared),
        recordings_router(site_of),
        plans_router(site_of),
        plan_images_router(site_of),
        basemap_router(shared.basemap),
        figures_router(site_of),
        zones_router(site_of),
        zone_occupancy_router(site_of),
        events_router(site_of, shared.stopping),
        destinations_router(site_of),
        receiver_networks_router(site_of),
        shares_router(site_of, share_links_of(shared.authenticator)),
        api_keys_router(site_of, api_keys_of(shared.authenticator)),
    )
