"""`dropanchor replay` of MCAP recordings: run all tags through the same ingest and engine as live."""

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import chain, groupby
from pathlib import Path
from typing import Any

from tqdm import tqdm

from dropanchor_schemas.wire import Reason
from dropanchor_service.answers.frames import FRAMES, STATES, published_states
from dropanchor_service.commands.replay_output import VALUES, Write, opened, values_of
from dropanchor_service.estimation.columns import Array, Frame
from dropanchor_service.offline.recorded_turns import OfflineService, settings_of
from dropanchor_service.recording.mcap_file import SESSION
from dropanchor_service.recording.reading import RecordingReader, Turn
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client.recording import RecordingError

COLUMNS = ("tag", "t_ns", *VALUES)
TOLERANCE_M = 1e-9
MAX_PENDING = 100_000  # poses that wait for the recorded estimates of the same times

_Place = tuple[float, float, str]  # x, y and their frame


def replay_files(arguments: argparse.Namespace, files: Sequence[Path]) -> int:
    """Replay the files and return 0. Raises RecordingError, SettingsError, OSError."""
    with ExitStack() as stack:
        write: Write = _discard
        if arguments.out:
            write = stack.enter_context(opened(arguments.out, COLUMNS))
        for _, group in groupby(files, _session):
            _replay_session(arguments, [RecordingReader(file) for file in group], write)
    if arguments.out:
        print(f"poses: {arguments.out}")
    return 0


def _discard(_: Iterable[Sequence[Any]]) -> None:
    pass


def _session(file: Path) -> str:
    """Return the session of the recording that the file belongs to. Each session starts with new estimators."""
    reader = RecordingReader(file)
    next(reader.turns(), None)
    return reader.metadata.get(SESSION, file.name)


def _replay_session(arguments: argparse.Namespace, readers: Sequence[RecordingReader], write: Write) -> None:
    turns = (turn for reader in readers for turn in reader.turns())
    first = next(turns, None)
    if first is None or first.site is None:
        raise RecordingError(f"{readers[0].path} is empty")
    settings = settings_of(readers[0].metadata, load_settings(arguments.config), arguments.engine)
    service, outcome = OfflineService(settings, first.site), Outcome()
    print(f"recorded {_utc(first.t_ns)}, {len(readers)} file(s), engine {settings.engine}")
    all_turns = tqdm(chain([first], turns), unit=" turns", unit_scale=True, desc="replayed", disable=None)
    for turn, poses in service.poses_of(all_turns):
        tags = [service.tags.rows.at(row).name for row in poses["row"].tolist()]
        outcome.add(turn, tags, poses)
        write(_rows(tags, poses))
    for line in [*outcome.lines(), *_findings(service), *_rejections(service, readers)]:
        print(line)


def _utc(t_ns: int) -> str:
    return f"{datetime.fromtimestamp(t_ns // 10**9, UTC):%Y-%m-%dT%H:%M:%SZ}"


@dataclass
class Outcome:
    """Statistics of the replayed poses, and their differences from the recorded ones.

    compared: poses with a recorded estimate of the same time. equal: of these, equal within TOLERANCE_M.
    one_sided: poses whose position is known on one side only, or in the site on one side only. worst_m: largest
    difference.
    """

    poses: Counter[str] = field(default_factory=Counter)
    states: dict[str, Counter[str]] = field(default_factory=dict)
    compared: int = 0
    equal: int = 0
    one_sided: int = 0
    worst_m: float = 0.0
    _positions: dict[tuple[str, int], _Place] = field(default_factory=dict)
    _estimates: list[tuple[str, int, _Place]] = field(default_factory=list)

    def add(self, turn: Turn, tags: Sequence[str], poses: Array) -> None:
        """Add the poses of a turn. A pose may come a turn earlier or later than recorded, so both sides are kept."""
        states = published_states(poses["state"], poses["frame"]).tolist()
        for tag, t_ns, x, y, frame, state in zip(
            tags, *(poses[name].tolist() for name in ("t_ns", "x", "y", "frame")), states, strict=True
        ):
            self.poses[tag] += 1
            self.states.setdefault(tag, Counter())[STATES[state]] += 1
            self._positions[tag, t_ns] = (x, y, FRAMES[frame])
        for tag, estimate in turn.estimates:
            place = estimate.get("relative_pose", estimate)  # older recordings have no relative_pose
            x, y = (place.get(name, math.nan) for name in ("x", "y"))
            self._estimates.append((tag, estimate["t_ns"], (x, y, estimate.get("frame", FRAMES[Frame.SITE]))))
        if len(self._positions) > MAX_PENDING:
            self._compare()

    def lines(self) -> Iterator[str]:
        """Yield the lines of the report."""
        self._compare()
        for tag, count in sorted(self.poses.items()):
            shares = ", ".join(f"{state} {n / count:.1%}" for state, n in self.states[tag].most_common())
            yield f"{tag}: {count} poses, {shares}"
        if self.compared:
            equal = f"{self.compared} compared, {self.equal} equal within a nanometre"
            yield f"recorded poses: {equal}, worst difference {self.worst_m:.3g} m"
        if self.one_sided:
            yield (
                f"recorded poses: {self.one_sided} not compared, because only the recording or only the replay has a "
                "position, or knows north"
            )
        if self.one_sided or self.equal < self.compared:
            yield (
                "Differences are normal for tags that were already running when the recording started: the replay "
                "starts with new estimators"
            )

    def _compare(self) -> None:
        pending = []
        for tag, t_ns, recorded in self._estimates:
            replayed = self._positions.get((tag, t_ns))
            if replayed is None:
                pending.append((tag, t_ns, recorded))
                continue
            difference_m = _difference_m(recorded, replayed)
            if difference_m is None:
                self.one_sided += 1
                continue
            self.compared += 1
            self.equal += difference_m <= TOLERANCE_M
            self.worst_m = max(self.worst_m, difference_m)
        self._estimates = pending[-MAX_PENDING:]
        self._positions.clear()


def _difference_m(one: _Place, other: _Place) -> float | None:
    """Return how far two places are apart, or None if they cannot be compared."""
    known = [not math.isnan(place[0]) for place in (one, other)]
    if not any(known):
        return 0.0
    return math.dist(one[:2], other[:2]) if all(known) and one[2] == other[2] else None


def _rows(tags: Sequence[str], poses: Array) -> Iterator[list[Any]]:
    for tag, t_ns, values in zip(tags, poses["t_ns"].tolist(), values_of(poses), strict=True):
        yield [tag, t_ns, *values]


def _findings(service: OfflineService) -> Iterator[str]:
    """Yield what was wrong with the sensors of each tag at the end."""
    for tag in service.tags.all():
        for found in tag.rows.findings.of(tag.row):
            yield f"{tag.name}: {found.sentence}"


def _rejections(service: OfflineService, readers: Sequence[RecordingReader]) -> Iterator[str]:
    registry = service.metrics.registry
    counts = {
        reason: int(registry.get_sample_value("dropanchor_rejected_total", {"reason": reason}) or 0)
        for reason in Reason
    }
    rejected = ", ".join(f"{count} {reason}" for reason, count in counts.items() if count)
    if rejected:
        yield f"not used: {rejected}"
    for reader in readers:
        if reader.read_error is not None:
            print(f"{reader.path} is truncated ({reader.read_error}): the rest of it is lost", file=sys.stderr)
