"""The routes that each site has, below its id, and an only site also without it."""

from fastapi import APIRouter

from dropanchor_service.api.routes.access import access_router
from dropanchor_service.api.routes.api_keys import api_keys_router
from dropanchor_service.api.routes.audit import audit_router
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
from dropanchor_service.api.routes.settings import settings_router
from dropanchor_service.api.routes.shares import shares_router
from dropanchor_service.api.routes.site import site_router
from dropanchor_service.api.routes.stream import stream_router
from dropanchor_service.api.routes.tags import tag_router, tags_router
from dropanchor_service.api.routes.track import track_router
from dropanchor_service.api.routes.track_file import track_file_router
from dropanchor_service.api.routes.tracks import tracks_router
from dropanchor_service.api.routes.zone_occupancy import zone_occupancy_router
from dropanchor_service.api.routes.zones import zones_router


def ingest_routers() -> tuple[APIRouter, ...]:
    """Return the routes that take samples. The key of a tag says of which site it is."""
    return (
        ingest_router(),
        ingest_phyphox_router(),
        ingest_health_router(),
        ingest_stream_router(),
    )


def site_routers() -> tuple[APIRouter, ...]:
    """Return the routes of a site."""
    return (
        poses_router(),
        tags_router(),
        tag_router(),
        site_router(),
        settings_router(),
        audit_router(),
        north_router(),
        remote_settings_router(),
        track_router(),
        track_file_router(),
        tracks_router(),
        coverage_router(),
        heat_map_router(),
        history_router(),
        stream_router(),
        access_router(),
        connect_router(),
        *ingest_routers(),
        recordings_router(),
        plans_router(),
        plan_images_router(),
        basemap_router(),
        figures_router(),
        zones_router(),
        zone_occupancy_router(),
        events_router(),
        destinations_router(),
        receiver_networks_router(),
        shares_router(),
        api_keys_router(),
    )
