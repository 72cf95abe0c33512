"""Run one tag again, from a checkpoint of the black box: the same code as live, and the same poses."""

from collections import Counter, deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from prometheus_client import Counter as PrometheusCounter

from dropanchor_schemas.past import IncidentKind
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import TagSettings
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.frames import STATES, in_site_frame
from dropanchor_service.blackbox.block import doubts_of
from dropanchor_service.blackbox.chosen import BoxError, chosen, turns_of
from dropanchor_service.checkpoints.format import CheckpointError
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.estimation.columns import POSE, Array, Frame, State
from dropanchor_service.ingest.decode import decode
from dropanchor_service.offline.recorded_turns import OfflineService, settings_of
from dropanchor_service.recording.reading import Turn
from dropanchor_service.settings.model import Settings
from dropanchor_service.store.anchor_doubts import AnchorDoubt

MOST_INCIDENTS = 200
SECOND_NS = 1_000_000_000
SURE_OF = (State.TRACKING, State.COASTING, State.DEGRADED)


class Rerun:
    """A tag of a site, and what becomes of it. `run_to` goes on from where the last one ended.

    poses: POSE of the run. sure_ns: when the tag last knew where it is, None if it never did. states: time, state and
    reason where they changed. incidents: what happened to its samples.
    Creating it raises BoxError.
    """

    def __init__(self, folder: Path, site: str, tag: str, from_ns: int, to_ns: int) -> None:
        pieces = chosen(folder, from_ns, to_ns)
        self.begin_ns = pieces[0].from_ns
        try:
            head, checkpoint = pieces[0].head(), pieces[0].checkpoint()
            document = head.documents[site]
            settings = settings_of(head.metadata, Settings(engine_threads=1), None)
            self.service = OfflineService(settings, document, TagSettings.model_validate(head.defaults[site]))
            if checkpoint is not None:
                self._restore(*checkpoint)
            self.service.engine.follow_doubts(0, doubts_of(site, head.doubts))  # one tag alone cannot tell
        except (OSError, KeyError, CheckpointError) as error:
            sentence = say("box_unusable", "The black box cannot be used at that time: {why}.", why=error)
            raise BoxError(sentence) from error
        self._name = tag
        self.poses: list[Array] = []
        self.sure_ns: int | None = None
        self.states: list[tuple[int, str, str]] = []
        self._sent: list[tuple[bytes, str, int]] = []  # payload, encoding and UTC of arrival, ns
        self.incidents: deque[dict[str, Any]] = deque(maxlen=MOST_INCIDENTS)
        self._counts = self._counted()
        references = {name for name, one in document.tags.items() if one.height_motion == "reference"}
        self._turns = turns_of(pieces, site, {tag, *references}, self.begin_ns, to_ns)
        self._next: Turn | None = None

    def _restore(self, layout: str, snapshot: Any) -> None:
        service = self.service
        state = ServiceState(service.sites, service.latest, service.engine, service.publishers)
        state.restore(state.as_present(layout, snapshot))

    @property
    def answers(self) -> Answers:
        """The answers of the service at the time that the run has reached."""
        service = self.service
        return Answers(service.site, service.tags, service.latest, service.clock.now_ns)

    @property
    def row(self) -> int | None:
        found = self.service.tags.find(self._name)
        return None if found is None else found.row

    @property
    def doubt(self) -> AnchorDoubt | None:
        """The anchor that is doubted on which the tag's poses rest."""
        return None if self.row is None else self.service.tags.rows.anchor_doubts.of(self.row)

    @property
    def settings(self) -> TagSettings:
        return self.service.site.tag_settings(self._name)

    def imu(self) -> dict[str, Array]:
        """Return acc and gyro (n, 3) that the tag sent, with when each arrived, UTC in ns."""
        payloads, encodings, arrivals = zip(*self._sent, strict=True) if self._sent else ((), (), ())
        sent = decode(payloads, encodings).columns()[0]
        values = {name: sent[name].astype(float) for name in ("acc", "gyro")}
        return values | {"arrival_ns": np.array(arrivals, np.int64)[sent["message"]]}

    def run_to(self, to_ns: int, adopt: bool = True) -> None:
        """Run the turns until a time. adopt: follow the changes of the settings, and which anchor is doubted."""
        for turn in self._until(to_ns):
            if not adopt:
                turn.site = turn.doubts = None
            self._take(turn)
        self._take(Turn(to_ns))

    def _until(self, to_ns: int) -> Iterator[Turn]:
        while True:
            turn = self._next or next(self._turns, None)
            self._next = None
            if turn is None:
                return
            if turn.t_ns > to_ns:
                self._next = turn
                return
            yield turn

    def _take(self, turn: Turn) -> None:
        poses = self.service.take(turn)
        self._sent += [message[1:] for message in turn.messages if message[0] == self._name]
        own = poses[poses["row"] == self.row] if self.row is not None else poses[:0]
        if len(own):
            self.poses.append(own.copy())
            self._note_state(own[-1])
            if is_sure(own[-1]):
                self.sure_ns = turn.t_ns
        self._note_incidents(turn.t_ns)

    def _note_state(self, pose: Array) -> None:
        published = in_site_frame(pose[None])[0]
        state, reason = STATES[published["state"]], REASONS[pose["reason"]]
        if not self.states or self.states[-1][1:] != (state, reason):
            self.states.append((int(pose["t_ns"]), state, reason))

    def _note_incidents(self, t_ns: int) -> None:
        counts = self._counted()
        if counts == self._counts:
            return
        for what, count in (counts - self._counts).items():
            last = next((one for one in reversed(self.incidents) if (one["kind"], one["reason"]) == what), None)
            if last is not None and t_ns - last["t_ns"] < SECOND_NS:
                last["count"] += count
            else:
                self.incidents.append({"t_ns": t_ns, "kind": what[0], "reason": what[1], "count": count})
        self._counts = counts

    def _counted(self) -> Counter[tuple[str, str | None]]:
        found, metrics = self.service.tags.find(self._name), self.service.metrics
        rejected = {} if found is None else {(IncidentKind.REJECTED.value, why): n for why, n in found.rejected.items()}
        of_all = {
            IncidentKind.CLOCK_JUMP: metrics.clock_jumps,
            IncidentKind.RESTART: metrics.sequence_restarts,
            IncidentKind.MISSING: metrics.given_up,
        }
        return Counter(rejected | {(kind.value, None): _value(counter) for kind, counter in of_all.items()})

    def track(self, from_ns: int, to_ns: int) -> dict[str, list[Any]]:
        """Return the `TrackColumns` of a period of the run."""
        poses = np.concatenate([np.empty(0, POSE), *self.poses])
        poses = in_site_frame(poses[(poses["t_ns"] >= from_ns) & (poses["t_ns"] <= to_ns)])
        names = {"x": "x", "y": "y", "heading_rad": "heading", "speed_mps": "speed", "sigma_pos_m": "sigma_pos"}
        columns: dict[str, list[Any]] = {field: poses[name].tolist() for field, name in names.items()}
        return (
            {"t_ns": poses["t_ns"].tolist()} | columns | {"state": [STATES[state] for state in poses["state"].tolist()]}
        )


def _value(counter: PrometheusCounter) -> int:
    return int(next(iter(counter.collect())).samples[0].value)


def is_sure(pose: Array) -> bool:
    """Return whether the tag knows where it is on the map, and which way it faces."""
    is_placed = pose["state"] in SURE_OF and pose["frame"] != Frame.RELATIVE
    return bool(is_placed and np.isfinite(pose["x"] + pose["y"] + pose["heading"]))
