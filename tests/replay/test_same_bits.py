"""The same messages give the same bits, also when the service restarts from a checkpoint after every message."""

from pathlib import Path

import pytest
from numpy.lib.recfunctions import repack_fields

from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.estimation.columns import State
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.recording_engine import RecordingEngine
from support.traffic import Message, known_starts, traffic

TAGS = 3
SECONDS = 12.0
SEED = 9


class Run:
    """A service without threads or network that writes its checkpoints to a folder."""

    def __init__(self, folder: Path) -> None:
        starts = known_starts(TAGS, SEED)
        del starts[tag_name(0)]  # this tag begins with many hypotheses
        self.engine = RecordingEngine()
        self.bench = IngestBench(engine=self.engine, folder=folder, tags=starts)
        self.state = self.bench.service_state()
        self.checkpoints = CheckpointFolder(folder / "checkpoints", self.state.layout, self.state.as_present)

    def fuse(self, message: Message) -> list[bytes]:
        """Fuse one message and return the bits of each batch that the engine returned for it."""
        before = len(self.engine.batches)
        self.bench.put(message.tag, message.payload, at_ns=message.due_ns)
        self.bench.ingest.turn()
        return [
            batch.poses.tobytes() + batch.hypotheses.tobytes() + batch.innovations.tobytes()
            for batch in self.engine.batches[before:]
        ]

    def engine_bits(self) -> dict[str, bytes]:
        """Return the bytes of the engine's state by array, without the padding between fields."""
        arrays = self.state.snapshot().arrays
        return {
            name: repack_fields(array, recurse=True).tobytes()
            for name, array in arrays.items()
            if name.startswith("engine.")
        }


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    return traffic(TAGS, SECONDS, SEED)


@pytest.fixture(scope="module")
def uninterrupted(messages: list[Message], tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, list[list[bytes]]]:
    """A run without interruption, and the bits that it returned for every message."""
    run = Run(tmp_path_factory.mktemp("uninterrupted"))
    returned = [run.fuse(message) for message in messages]
    assert {State.TRACKING, State.AMBIGUOUS} <= set(run.engine.poses()["state"].tolist())
    return run, returned


def test_a_replay_gives_the_same_bits(
    messages: list[Message], uninterrupted: tuple[Run, list[list[bytes]]], tmp_path: Path
) -> None:
    run = Run(tmp_path)
    assert [run.fuse(message) for message in messages] == uninterrupted[1]
    assert run.engine_bits() == uninterrupted[0].engine_bits()


def test_a_restart_from_a_checkpoint_after_every_message_changes_no_bit(
    messages: list[Message], uninterrupted: tuple[Run, list[list[bytes]]], tmp_path: Path
) -> None:
    run = Run(tmp_path)
    returned = []
    for message in messages:
        returned.append(run.fuse(message))
        run.checkpoints.write(run.state.snapshot())
        run = Run(tmp_path)
        found, complaints = run.checkpoints.newest()
        assert found is not None
        assert complaints == []
        run.state.restore(found)
    assert returned == uninterrupted[1]
    assert run.engine_bits() == uninterrupted[0].engine_bits()
