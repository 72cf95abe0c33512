"""A shard: one process that stands by for any bucket, serves the one it gets, and ends when that is another's."""

import gc
import logging
import os
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Timer

from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.cluster import leases
from dropanchor_service.cluster.database import DatabaseError, connect
from dropanchor_service.cluster.leases import Claimant
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.engines.compiled import compiled_engine
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.ownership.in_cluster import digest_of_sites
from dropanchor_service.runtime.memory import HeapTrimmer
from dropanchor_service.runtime.private_files import keep_private
from dropanchor_service.service import Service
from dropanchor_service.settings.buckets import buckets_in
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.served import settings_of_bucket
from dropanchor_service.settings.sources import load_settings
from dropanchor_service.shards.any_bucket import AnyStandby, AskedToEndError, Owned
from dropanchor_service.shards.starting import BACK_OFF_S, EXIT_GONE, Starting
from dropanchor_service.store import LatestPoses, Sites, SiteStore

LEAVE_S = 5.0  # that a process has to close what it has open
CHECK_S = 0.25
STUCK_S = 30.0  # without progress

_log = logging.getLogger(__name__)


def run_shard(name: str, config: Path, starting: Starting) -> None:
    """Stand by, serve, and end the process. Nothing else may run in it. starting: ends before it stands by."""
    try:
        settings = load_settings(config)
        keep_private(settings.data_dir)
        standby = _standby(settings, name, starting.version)
        starting.end()
        _serve(settings, standby.wait(), name)
    except AskedToEndError:
        _log.info("%s ends, to start again with the version that is installed", name)
    except Exception as error:
        starting.failed(error)
        _log.exception("the shard %s has failed, and starts again in %.0f s", name, BACK_OFF_S)
        time.sleep(BACK_OFF_S)
    os._exit(EXIT_GONE)


def buckets_of(settings: Settings) -> list[str]:
    """Return the buckets of a cluster: those of the ids of sites, or the one that is named."""
    return buckets_in(settings.site_ids) or [settings.cluster.bucket or ""]


def claimants_of(settings: Settings, name: str, version: str) -> dict[str, Claimant]:
    """Return what a shard claims each bucket with. version: that it runs."""
    cluster = settings.cluster
    digests = {bucket: digest_of_sites(settings_of_bucket(settings, bucket)) for bucket in buckets_of(settings)}
    return {bucket: Claimant(name, "", digest, cluster.lease_s, version) for bucket, digest in digests.items()}


def _standby(settings: Settings, name: str, version: str) -> AnyStandby:
    assert settings.cluster.url is not None
    engine = compiled_engine(settings, CompilationProgress())
    sites = Sites([(SiteStore(settings.site, {}), settings.quota)])
    layout = ServiceState(sites, LatestPoses(), GuardedEngine(engine, sites, Metrics()), Publishers()).layout
    gc.collect()
    gc.freeze()
    claimants = claimants_of(settings, name, version)
    _log.info("%s stands by for any of %d buckets", name, len(claimants))
    return AnyStandby(partial(connect, settings.cluster.url, name), claimants, layout)


def _serve(settings: Settings, owned: Owned, name: str) -> None:
    """Serve the bucket until it is another's, or until something in this process has died."""
    began_s = time.monotonic()
    own = settings_of_bucket(settings, owned.bucket)
    cluster = own.cluster.model_copy(update={"name": name})
    own = own.model_copy(update={"cluster": cluster, "http": own.http.model_copy(update={"port": 0})})
    try:
        service = Service(own, claimed=owned.claimed)
        service.__enter__()
    except Exception:
        _give_back(settings.cluster.url or "", owned)
        raise
    _log.info("%s serves %s after %.2f s", name, owned.bucket, time.monotonic() - began_s)
    heap = HeapTrimmer()
    stuck_since_s: float | None = None
    while not service.has_died and (stuck_since_s is None or time.monotonic() - stuck_since_s < STUCK_S):
        heap.trim()
        time.sleep(CHECK_S)
        stuck_since_s = None if service.makes_progress else stuck_since_s or time.monotonic()
    _log.warning("%s ends: %s", name, service.gone or "a part of it has died or is stuck")
    end = Timer(LEAVE_S, partial(os._exit, EXIT_GONE))
    end.daemon = True
    end.start()
    service.__exit__(None, None, None)


def _give_back(url: str, owned: Owned) -> None:
    """Release the lease of a bucket that cannot be served here."""
    with suppress(DatabaseError), connect(url, "shard") as connection:
        leases.release(connection, owned.bucket, owned.claimed.claim.epoch)
