"""The wiring of the service: its parts, in the order in which they start. They stop in reverse order."""

import logging
import os
import socket
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from functools import partial
from threading import Event
from typing import TYPE_CHECKING, Self

import zenoh
from fastapi import FastAPI

from dropanchor_schemas.keys import tag_alive_key
from dropanchor_service.answers.of_sites import answers_of_sites
from dropanchor_service.api.http.server import build_server, listen
from dropanchor_service.api.http.thread import HttpThread
from dropanchor_service.api.starting import CurrentApp, Gate, create_starting_app
from dropanchor_service.blackbox.opened import beside, open_box
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.checkpoints.thread import CheckpointThread
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.engines.compiled import compiled_engine
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.ingest.admission import Admission
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.ingest.from_http import FromHttp
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.period import Period
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.sequence_states import sequence_states
from dropanchor_service.ingest.thread import IngestThread
from dropanchor_service.ingest.turn import Ingest
from dropanchor_service.metrics.health import HealthGauges
from dropanchor_service.metrics.operation import OperationGauges
from dropanchor_service.metrics.registry import FleetGauges, Metrics
from dropanchor_service.ownership.choose import ownership_of
from dropanchor_service.ownership.processed import Processed
from dropanchor_service.persistence.reloading import reload_settings
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.persistence.site_files import own_data_folder, put_site_files_in_place
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.runtime.supervision import Supervision
from dropanchor_service.security.credentials import certificate_of, credentials_of, expiries_of
from dropanchor_service.serving import Serving
from dropanchor_service.settings.http_url import http_url
from dropanchor_service.settings.many_sites import refuse_too_many_sites
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import LatestPoses
from dropanchor_service.store.shared import Shared
from dropanchor_service.zenoh_io.caches import ZenohCaches
from dropanchor_service.zenoh_io.events import ZenohEvents
from dropanchor_service.zenoh_io.exposure import refuse_exposure
from dropanchor_service.zenoh_io.intake import ZenohIntake
from dropanchor_service.zenoh_io.link import ZenohLink
from dropanchor_service.zenoh_io.publishers import ZenohPoses
from dropanchor_service.zenoh_io.queryables import ZenohAnswers
from dropanchor_service.zenoh_io.remote_settings import ZenohRemoteSettings

if TYPE_CHECKING:
    from dropanchor_service.cluster.leases import Claimed

HTTP_STOP_S = 1.5

_log = logging.getLogger(__name__)


class Service:
    """The running service: `with Service(settings) as service`.

    Creating or entering it raises SettingsError, ListenError or ZenohError, each with a message for the user.
    url: the address of the page and the REST interface, known once the server listens.
    """

    def __init__(
        self,
        settings: Settings,
        compiling: AbstractContextManager[None] | None = None,
        standing_by: Callable[[], None] = lambda: None,
        claimed: "Claimed | None" = None,
    ) -> None:
        """compiling: entered while the kernels are compiled, and while this process is a standby, so that a signal can
        interrupt that. standing_by: called now and then by a standby. claimed: the bucket, if it was claimed before."""
        refuse_too_many_sites(settings)
        self._settings = settings
        self._credentials = credentials_of(settings)
        refuse_exposure(settings, self._credentials)
        self._certificate = certificate_of(settings.http, self._credentials)
        self._compiling = compiling or nullcontext()
        self._stopping = Event()
        self._opened = ExitStack()
        self._supervision = Supervision()
        self._progress = CompilationProgress()
        self.metrics = Metrics()
        self.clock = UtcClock()
        self.latest = LatestPoses()
        self._recovery = Recovery(settings.data_dir)
        self._opened.enter_context(own_data_folder(settings, claimed is not None, self._recovery.note))
        put_site_files_in_place(settings)
        self.sites = open_sites(settings, self._recovery)
        self._ownership = ownership_of(settings, self.sites, self.metrics, standing_by, claimed)
        self._serving = Serving(
            settings, self._credentials, self.sites, self.latest, self.clock.now_ns, self.metrics, self._recovery
        )
        tracks, self._publishers = [one.tracks for one in self._serving.folders.all], Publishers()
        self.answers = answers_of_sites(self.sites, self.latest, self.clock.now_ns, tracks, self._publishers)
        self._period = Period(settings.ingest.period_ms * 1e-3)
        self._buffer = MessageBuffer(int(settings.ingest.buffer_mib * 2**20), round(settings.ingest.max_wait_ms * 1e6))
        self._processed = Processed(lambda: self._buffer.depth, self._buffer.wake)
        watched = tag_alive_key(settings.site_ids[0], "-")
        self._link = ZenohLink(settings.zenoh, self._zenoh_parts, watched, self._credentials)
        self._register_gauges()

    def _register_gauges(self) -> None:
        self.metrics.register(HealthGauges(self.sites, self.clock.now_ns, self._publishers))
        expiries = partial(expiries_of, self._certificate, self._credentials)
        self.metrics.register(OperationGauges(self.problems, self.impairments, self._settings.data_dir, expiries))
        self.metrics.register(FleetGauges(self.sites, self.latest, self.clock.now_ns, lambda: self._buffer.depth))

    def __enter__(self) -> Self:
        with self._opened:
            bound = listen(self._settings.http.host, self._settings.http.port)
            self._opened.callback(bound.close)
            self._opened.enter_context(self._supervision)
            self._http = self._http_thread(bound)
            self._opened.callback(self._http.join, HTTP_STOP_S)
            self._http.start()
            self._opened.callback(self._http.ask_to_stop)
            self._progress.page = f"{self.url}/"
            with self._compiling:
                self._build_ingest(compiled_engine(self._settings, self._progress))
                self._ownership.stand_by(self.url, self._shared(), lambda: self._link.problem is None)
            self._opened.enter_context(self._ownership)
            self._opened.enter_context(self._serving.folders)
            self._start_checkpoints()
            self._opened.enter_context(self._box or nullcontext())
            self._thread.start()
            self._opened.callback(self._thread.stop)
            self._opened.enter_context(self._serving.zone_events)
            self._opened.enter_context(self._link)
            app = self._ownership.around(self._full_app())
            self._app.app = Gate(self._ownership.may_serve, app, self._app.app)
            # The HTTP server is told to stop first and joined last, so that a stuck client does not delay the rest.
            self._opened.callback(self._http.ask_to_stop)
            self._opened = self._opened.pop_all()
        name = f"{len(self.sites)} sites" if self.sites.only is None else f"site {self.sites.only.id}"
        _log.info("ready at %s, %s, engine %s", self.url, name, self._settings.engine)
        return self

    def _start_checkpoints(self) -> None:
        if self._checkpoints is not None:
            self._checkpoints.load()
            self._checkpoints.start()
            self._opened.callback(self._write_last_checkpoint, self._checkpoints)
            return
        engine = f"not possible with the engine {self._settings.engine}"
        reason = "data_dir is not set" if self._settings.data_dir is None else engine
        _log.info("no checkpoints: %s; after a restart all tags start afresh", reason)

    def _shared(self) -> dict[str, Shared]:
        """Return what people change over REST and the owner of the sites shares with its successor, by name."""
        return {**self._serving.zone_events.shared, **{f"{site.id}/site.json": site.store for site in self.sites}}

    def _build_ingest(self, engine: Engine) -> None:
        guarded = GuardedEngine(engine, self.sites, self.metrics)
        state = ServiceState(self.sites, self.latest, guarded, self._publishers) if guarded.keeps_state else None
        self._box = open_box(self._settings, self.sites, state, self.clock.now_ns)
        self._ingest = Ingest(
            self._buffer,
            Admission(self.sites),
            guarded,
            self._publishers,
            self.sites,
            self.latest,
            self.metrics,
            self.clock,
            observers=beside(self._box, self._serving.folders.observers),
            reorder_ns=round(self._settings.ingest.reorder_ms * 1e6),
        )
        self._from_http = FromHttp(self.sites, self._ingest.health, self.clock, self._buffer.append)
        self._checkpoints: CheckpointThread | None = None  # without a place or with an engine that keeps no state
        if state is not None and (kept := self._ownership.checkpoints(state, self._recovery)) is not None:
            self._checkpoints = CheckpointThread(state, kept, self.metrics, self._settings.checkpoint_s, self.clock)
        self._thread = IngestThread(
            self._ingest,
            self._buffer,
            self.metrics,
            self._period,
            self._between_turns,
            self._ownership.may_serve,
        )

    def _between_turns(self) -> None:
        if self._checkpoints is not None:
            self._checkpoints.between_turns()
        if self._box is not None:
            self._box.between_turns(self._ingest.has_pending)
        self._processed.between_turns()

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._serving.stop()
        self._opened.close()
        _log.info("stopped")

    def reload(self, settings: Settings) -> None:
        reload_settings(self._settings, settings, self.sites)
        self._http.reload_certificate()

    def problems(self) -> Sequence[str]:
        """Return why the service cannot do its work now; empty when it can."""
        found = (self._thread.problem, self._link.problem)
        dead = [f"the thread {name} has died" for name in self._dead_threads()]
        return [*dead, *(problem for problem in found if problem is not None)]

    def impairments(self) -> Sequence[str]:
        """Return what does not work although the service can do its main work."""
        of_checkpoints = self._checkpoints.problem if self._checkpoints else None
        of_box, of_clock = self._box.problem if self._box else None, self.clock.problem
        of_parts = [*self._ownership.impairments(), *self._serving.problems(), *self._recovery.problems()]
        found = [*of_parts, of_checkpoints, of_box, of_clock]
        return [problem for problem in found if problem is not None]

    @property
    def has_died(self) -> bool:
        """Whether a thread that must run has died, or the sites are another process's. It has to be restarted then."""
        return bool(self._dead_threads() or self.gone)

    @property
    def gone(self) -> str:
        """Why this process may no longer serve its sites; empty while it may."""
        return self._ownership.gone

    @property
    def makes_progress(self) -> bool:
        """Whether samples arrive and are processed."""
        return self._thread.problem is None and not self._link.is_deaf

    def _dead_threads(self) -> list[str]:
        threads = {"http": self._http.is_alive, "ingest": self._thread.is_alive}
        if self._checkpoints is not None:
            threads["checkpoints"] = self._checkpoints.is_alive
        return sorted({*self._supervision.dead_threads, *(name for name, is_alive in threads.items() if not is_alive)})

    def _write_last_checkpoint(self, checkpoints: CheckpointThread) -> None:
        if self.gone:
            checkpoints.stop_without_writing()
        elif self._thread.is_alive or "ingest" in self._supervision.dead_threads:
            _log.error("the ingest thread did not stop cleanly: the previous checkpoint stays the newest one")
        else:
            checkpoints.stop()

    def _zenoh_parts(self, session: zenoh.Session) -> list[AbstractContextManager[object]]:
        service_id = f"{socket.gethostname()}-{os.getpid()}"[-64:]
        may_serve = self._ownership.may_serve
        return [
            *self._ownership.zenoh_parts(session),
            self._intake(session),
            ZenohAnswers(session, self.answers, service_id, self.metrics, may_serve),
            ZenohPoses(session, self.answers, self.metrics, self._ownership.may_publish),
            ZenohRemoteSettings(session, self.sites, self.metrics, may_serve),
            ZenohEvents(session, self._serving.zone_events.stores, self.metrics, may_serve),
        ]

    def _intake(self, session: zenoh.Session) -> ZenohIntake:
        caught_up = partial(self._ownership.caught_up, self._processed.wait)
        caches = ZenohCaches(session, self.sites, self.metrics, self.clock, caught_up)
        catch_up = CatchUp(
            self._buffer,
            expected=[self.sites.samples_key(tag.row) for tag in self.sites.rows.all() if self.sites.is_served(tag)],
            states_of=sequence_states(self.sites, self._publishers),
            ask=caches.ask,
            new_publisher_limit=caches.new_publisher_limit,
        )
        self._from_http.on_live = catch_up.on_live
        self._ingest.ask_on_gap(catch_up.on_gap)
        return ZenohIntake(session, self.sites, self._ingest, catch_up, caches, self.metrics, self.clock, self._period)

    def _http_thread(self, bound: socket.socket) -> HttpThread:
        """Return the thread of the HTTP server. Until the service is ready, it serves the page with the progress."""

        def reason() -> str:
            return self._ownership.sentence or self._progress.sentence

        self._app = CurrentApp(create_starting_app(reason, gauges=self._ownership.gauges, border=self._serving.border))
        host, port = bound.getsockname()[:2]
        self.url = http_url(host, port, is_encrypted=self._certificate is not None)
        proxies = [str(network) for network in self._settings.http.trusted_proxies]
        server = build_server(self._app, self._stopping, certificate=self._certificate, trusted_proxies=proxies)
        return HttpThread(server, bound)

    def _full_app(self) -> FastAPI:
        def ready() -> tuple[bool, Sequence[str]]:
            return not (found := self.problems()), found

        takes = (self._from_http.samples, self._from_http.health)
        return self._serving.app(self.answers, ready, self.impairments, self._stopping, *takes, self.url, self._box)
