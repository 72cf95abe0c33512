"""What a process asks about its sites, and the answers of one that is alone."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Self

import zenoh
from prometheus_client.registry import Collector
from starlette.types import ASGIApp

from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.format import Checkpoints
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.settings.model import Settings
from dropanchor_service.store.shared import Shared

ZenohParts = list[AbstractContextManager[object]]


class Ownership:
    """A process that is alone. In a cluster, `ClusterOwnership` answers.

    Use it as a context manager around all that serves the sites, after `stand_by`.
    """

    def __init__(self, settings: Settings) -> None:
        self._folder = settings.data_dir

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return

    @property
    def sentence(self) -> str:
        """Why this process does not serve the sites now, for people; empty before `stand_by`."""
        return ""

    @property
    def gone(self) -> str:
        """Why this process has to end; empty while it need not."""
        return ""

    @property
    def gauges(self) -> Collector | None:
        """What a standby shows of its metrics."""
        return None

    def checkpoints(self, state: ServiceState, recovery: Recovery) -> Checkpoints | None:
        """Return the place for checkpoints, None if there is none. recovery: reports those that are damaged."""
        if self._folder is None:
            return None
        return CheckpointFolder(self._folder / "checkpoints", state.layout, state.as_present, recovery)

    def stand_by(self, page: str, shared: Mapping[str, Shared], hears_others: Callable[[], bool]) -> None:
        """Return when this process serves the sites.

        page: its address. shared: what people change over REST, by name. hears_others: whether there is a connection to
        the router.
        """

    def may_serve(self) -> bool:
        """Return whether poses may leave this process now."""
        return True

    def may_publish(self) -> bool:
        """Return whether poses may be published now, for readers who hear other owners of the sites, too."""
        return self.may_serve()

    def caught_up(self, processed: Callable[[], object]) -> None:
        """Note that this process has what the former owner had. processed: waits until that has become poses."""

    def impairments(self) -> Sequence[str]:
        """Return what does not work although this process serves the sites."""
        return []

    def around(self, app: ASGIApp) -> ASGIApp:
        """Return the application with what the API nodes of a cluster need."""
        return app

    def zenoh_parts(self, session: zenoh.Session) -> ZenohParts:  # noqa: ARG002 - a process that is alone needs none
        """Return what this takes in a session."""
        return []
