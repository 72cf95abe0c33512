"""Run a recording through the same ingest and engine as live data, turn by turn, as fast as possible."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.site import TagSettings
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.ingest.admission import Admission
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.turn import MESSAGES_PER_TURN, Ingest
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.recording.reading import Turn
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import LatestPoses, Sites, SiteStore
from dropanchor_service.store.site_values import SiteDocument

SETTLE_NS = 1_000_000_000  # after this time no message is still waiting in a reorder buffer
_BUFFER_BYTES = 2**30
_MAX_TAGS = 1_000_000


class RecordedClock(UtcClock):
    """A clock that shows the time of the replayed turn."""

    def __init__(self) -> None:
        super().__init__()
        self.t_ns = 0

    def now_ns(self) -> int:
        return self.t_ns


class OfflineService:
    """The ingest and the engine of the service without a network. metrics: the same counters as live.

    What a checkpoint holds may be restored before the first turn.
    """

    def __init__(self, settings: Settings, document: SiteDocument, defaults: TagSettings | None = None) -> None:
        self.site = SiteStore(document.site, dict(document.tags), tag_defaults=defaults)
        self.sites = sites = Sites([(self.site, Quota("accept", _MAX_TAGS, _MAX_TAGS))])
        self.tags = sites[0].tags
        self.metrics = Metrics()
        self.engine = GuardedEngine(create_engine(settings), sites, self.metrics)
        self.latest, self.publishers = LatestPoses(), Publishers()
        self.clock = RecordedClock()
        self._buffer = MessageBuffer(_BUFFER_BYTES)
        self._poses: list[Array] = []
        self._ingest = Ingest(
            self._buffer,
            Admission(sites),
            self.engine,
            self.publishers,
            sites,
            self.latest,
            self.metrics,
            self.clock,
            observers=Observers(poses=self._poses.append),
            reorder_ns=round(settings.ingest.reorder_ms * 1e6),
        )

    def poses_of(self, turns: Iterable[Turn]) -> Iterator[tuple[Turn, Array]]:
        """Yield each turn with its POSE rows, and one last turn for messages that were still pending."""
        last_ns = 0
        for turn in turns:
            last_ns = turn.t_ns
            yield turn, self.take(turn)
        end = Turn(last_ns + SETTLE_NS)
        yield end, self.take(end)

    def take(self, turn: Turn) -> Array:
        """Run a turn. Return its POSE rows."""
        self.clock.t_ns = turn.t_ns
        if turn.site is not None:
            self._adopt(turn.site)
        if turn.doubts is not None:
            self.engine.follow_doubts(0, turn.doubts)
        self._ingest.turn()  # releases pending messages that were due before this turn
        for start in range(0, len(turn.messages), MESSAGES_PER_TURN):
            for tag, payload, encoding, arrival_ns in turn.messages[start : start + MESSAGES_PER_TURN]:
                self._buffer.append(samples_key(self.site.site.id, tag), payload, encoding, arrival_ns)
            self._ingest.turn()
        poses, self._poses[:] = np.concatenate([np.empty(0, POSE), *self._poses]), []
        return poses

    def _adopt(self, document: SiteDocument) -> None:
        """Apply the site and the tag settings that are valid from this turn on."""
        if document.site != self.site.site:
            self.site.set_site(document.site)
        for tag, settings in _changes(self.site.document, document):
            self.site.set_tag(tag, settings)


def settings_of(metadata: Mapping[str, str], given: Settings, engine: str | None) -> Settings:
    """Return the given settings with the engine and the parameters of the recording. `engine` overrides its engine."""
    update: dict[str, object] = {"engine": engine or metadata.get("engine", given.engine)}
    for name in ("paper", "ingest"):
        if name in metadata:
            update[name] = type(getattr(given, name)).model_validate_json(metadata[name])
    return given.model_copy(update=update)


def _changes(before: SiteDocument, after: SiteDocument) -> list[tuple[str, TagSettings]]:
    return [(tag, settings) for tag, settings in after.tags.items() if before.tags.get(tag) != settings]
