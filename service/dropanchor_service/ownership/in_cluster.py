"""A process in a cluster: first a standby, then the owner of its bucket, until another process is."""

import hashlib
import logging
import socket
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Self

import zenoh
from pydantic import ValidationError
from starlette.types import ASGIApp

from dropanchor_service.api.http.of_cluster import FromNodes, NamesOwner
from dropanchor_service.checkpoints.format import CheckpointError
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.cluster import leases, sentences
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.checkpoint_objects import CheckpointObjects
from dropanchor_service.cluster.database import Connection, DatabaseError, connect
from dropanchor_service.cluster.leases import Claimant, Claimed
from dropanchor_service.cluster.owner import Renewal
from dropanchor_service.cluster.shared_state import CheckpointRow, save_document
from dropanchor_service.cluster.standby import Standby
from dropanchor_service.cluster.tenure import Standing, Tenure
from dropanchor_service.cluster.versions import installed
from dropanchor_service.metrics.cluster import ClusterGauges
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.ownership.address import address_of
from dropanchor_service.ownership.alone import Ownership, ZenohParts
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security.node_secret import node_secret_of
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store import Sites
from dropanchor_service.store.shared import Shared
from dropanchor_service.zenoh_io.owner_token import ZenohOwner

if TYPE_CHECKING:
    from dropanchor_service.checkpoints.objects import ObjectFolder

OF_THE_SITES = {
    *("engine", "site", "sites", "tags", "tag_defaults", "unknown_tags", "max_unconfirmed_tags", "max_tags", "paper"),
}
"""Settings that must be equal in all processes that can own a bucket."""

_log = logging.getLogger(__name__)


class ClusterOwnership(Ownership):
    """See `Ownership`. Creating it raises SettingsError."""

    def __init__(
        self,
        settings: Settings,
        sites: Sites,
        metrics: Metrics,
        on_look: Callable[[], None],
        claimed: Claimed | None = None,
    ) -> None:
        super().__init__(settings)
        refuse_unfit(settings)
        self._objects = checkpoint_folder_of(settings)
        cluster = settings.cluster
        assert cluster.url is not None
        assert cluster.bucket is not None
        name = cluster.name or socket.gethostname()
        self._bucket = cluster.bucket
        self._sites = sites
        self._on_look = on_look
        self._node_secret = node_secret_of(cluster.node_secret)
        self._connect: Callable[[], Connection] = partial(connect, cluster.url, name)
        self._who = Claimant(name, cluster.address or "", digest_of_sites(settings), cluster.lease_s, installed())
        self._claimed = claimed
        self._settings = settings
        self._standby: Standby | None = None
        self._tenure: Tenure | None = None
        self._follows = False  # the former owner publishes until this process has caught up
        self._token: ZenohOwner | None = None
        self._kept: CheckpointRow | CheckpointObjects | None = None
        metrics.register(self.gauges)

    @property
    def gauges(self) -> ClusterGauges:
        return ClusterGauges(self._bucket, self._state)

    def checkpoints(
        self,
        state: ServiceState,
        recovery: Recovery,  # noqa: ARG002 - the database and the store keep no damaged ones
    ) -> CheckpointRow | CheckpointObjects:
        if self._objects is None:
            self._kept = CheckpointRow(self._connect, self._bucket, state.layout, state.as_present)
        else:
            self._kept = CheckpointObjects(self._connect, self._bucket, self._objects, state.layout, state.as_present)
        return self._kept

    def stand_by(self, page: str, shared: Mapping[str, Shared], hears_others: Callable[[], bool]) -> None:
        assert self._kept is not None
        claim, asked_s = self._claimed or self._waited(page, self._kept.layout)
        if self._claimed is not None:
            self._show_address(claim.epoch, page)
        self._tenure = Tenure(claim.epoch, self._who.lease_s, boot_s, hears_others, asked_s)
        self._follows = claim.was_moved
        self._renewal = Renewal(self._connect, self._bucket, self._who.lease_s, self._tenure)
        self._kept.own(claim)
        for site in self._sites:
            site.store.epoch = claim.epoch
        for document, kept in shared.items():
            save = partial(save_document, self._connect, self._bucket, claim.epoch, document)
            try:
                kept.share(claim.documents.get(document), save)
            except (OSError, ValidationError) as error:
                raise SettingsError(f"cluster: {document} of {self._bucket} cannot be shared: {error}") from error

    def _waited(self, page: str, layout: str) -> Claimed:
        _log.info("standing by at %s, for %s", page, self._bucket)
        self._standby = Standby(self._connect, self._bucket, self._who, layout)
        return self._standby.wait(self._on_look)

    def _show_address(self, epoch: int, page: str) -> None:
        """Tell API nodes where this shard is. Without the database, they do not learn it."""
        with suppress(DatabaseError), self._connect() as connection:
            leases.set_address(connection, self._bucket, epoch, address_of(self._settings, page))

    def __enter__(self) -> Self:
        self._renewal.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._renewal.__exit__(None, None, None)
        if self._kept is not None:
            self._kept.close()

    @property
    def sentence(self) -> str:
        if self._tenure is None:
            return "" if self._standby is None else self._standby.sentence
        if self._tenure.standing is Standing.IN_DOUBT:
            return sentences.in_doubt(self._bucket)
        return sentences.gone(self._bucket, self.gone) if self.gone else sentences.takes_over(self._bucket)

    @property
    def gone(self) -> str:
        if self._tenure is None or self._tenure.standing is not Standing.LOST:
            return ""
        return self._tenure.why_lost

    def may_serve(self) -> bool:
        return self._tenure is not None and self._tenure.may_serve

    def may_publish(self) -> bool:
        return not self._follows and self.may_serve()

    def caught_up(self, processed: Callable[[], object]) -> None:
        if self._follows:
            processed()  # readers drop the poses of the former owner from the first pose of this one on
            self._follows = False
        if self._token is not None:
            self._token.announce()

    def impairments(self) -> Sequence[str]:
        if self._tenure is None or self._tenure.age_s <= self._who.lease_s:
            return []
        error = self._renewal.database_error or f"for {self._tenure.age_s:.0f} s"
        return [
            f"the database of the cluster does not answer ({error}): this process goes on as the owner of "
            f"{self._bucket}, epoch {self._tenure.epoch}, until another one takes over"
        ]

    def around(self, app: ASGIApp) -> ASGIApp:
        assert self._tenure is not None
        return NamesOwner(FromNodes(app, self._node_secret), self._bucket, self._tenure.epoch)

    def zenoh_parts(self, session: zenoh.Session) -> ZenohParts:
        assert self._tenure is not None
        self._token = ZenohOwner(session, self._bucket, self._tenure.epoch, self._tenure.saw_epoch)
        return [self._token]

    def _state(self) -> tuple[int, float] | None:
        return None if self._tenure is None else (self._tenure.epoch, self._tenure.age_s)


def digest_of_sites(settings: Settings) -> str:
    """Return a digest of the settings that all owners of a bucket must share."""
    return hashlib.blake2b(settings.model_dump_json(include=OF_THE_SITES).encode(), digest_size=8).hexdigest()


def checkpoint_folder_of(settings: Settings) -> "ObjectFolder | None":
    """Return the folder of the checkpoints, None if the database holds them. Raises SettingsError."""
    url = settings.cluster.checkpoints
    if url is None:
        return None
    try:
        from dropanchor_service.checkpoints.objects import ObjectFolder

        return ObjectFolder(url)
    except ImportError as error:
        sentence = "cluster.checkpoints needs the extra `s3`: pip install 'dropanchor-service[s3]'"
        raise SettingsError(sentence) from error
    except CheckpointError as error:
        raise SettingsError(f"cluster.checkpoints: {error}") from error


def refuse_unfit(settings: Settings) -> None:
    """Raise SettingsError for what no other process could go on with."""
    if not settings.zenoh.connect and settings.zenoh.config_file is None:
        raise SettingsError(
            "cluster.url: the processes need one router that outlives them: start `dropanchor router`, and set "
            "zenoh.connect (--zenoh-connect)"
        )
    if settings.engine != "fleet":
        raise SettingsError(
            f"cluster.url: the engine {settings.engine} keeps no state that another process could go on from; use fleet"
        )
