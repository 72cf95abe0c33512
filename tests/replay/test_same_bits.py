"""The same messages give the same bits: replayed, and cut by a checkpoint after every single one of them."""

from pathlib import Path

import pytest
from numpy.lib.recfunctions import repack_fields

from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.estimation.columns import PoseBatch, SampleBatch, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_tag_client.simulator.live import start_poses, tag_name
from support.ingest import Bench
from support.traffic import Message, traffic

TAGS = 3
SECONDS = 12.0
SEED = 9


class Recorded(FleetEngine):
    """Keeps the bits that it gave."""

    def __init__(self) -> None:
        super().__init__()
        self.given: list[bytes] = []
        self.states: set[State] = set()

    def process(self, samples: SampleBatch) -> PoseBatch:
        batch = super().process(samples)
        self.given.append(batch.poses.tobytes() + batch.hypotheses.tobytes() + batch.innovations.tobytes())
        self.states |= {State(state) for state in batch.poses["state"].tolist()}
        return batch


class Run:
    """A service without network, whose state is kept in a folder."""

    def __init__(self, folder: Path) -> None:
        starts = {
            tag_name(index): {"start": {"x": pose.x, "y": pose.y, "heading_rad": pose.heading_rad}}
            for index, pose in enumerate(start_poses(TAGS, seed=SEED))
            if index > 0  # the first one has to find out where it is, with many hypotheses
        }
        self.engine = Recorded()
        self.bench = Bench(engine=self.engine, folder=folder, tags=starts)
        self.state = self.bench.whole_state()
        self.checkpoints = CheckpointFolder(folder / "checkpoints", self.state.layout, self.state.template)

    def take(self, message: Message) -> list[bytes]:
        """What the engine gives for it."""
        before = len(self.engine.given)
        self.bench.put(message.tag, message.payload, at_ns=message.due_ns)
        self.bench.ingest.turn()
        return self.engine.given[before:]

    def bits(self) -> dict[str, bytes]:
        """The state of the engine, without the gaps between fields."""
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
def whole(messages: list[Message], tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, list[list[bytes]]]:
    """A run without a break, and what it gave for every message."""
    run = Run(tmp_path_factory.mktemp("whole"))
    given = [run.take(message) for message in messages]
    assert run.engine.states >= {State.TRACKING, State.AMBIGUOUS}
    return run, given


def test_a_replay_gives_the_same_bits(
    messages: list[Message], whole: tuple[Run, list[list[bytes]]], tmp_path: Path
) -> None:
    run = Run(tmp_path)
    assert [run.take(message) for message in messages] == whole[1]
    assert run.bits() == whole[0].bits()


def test_a_checkpoint_after_every_message_and_a_restart_from_it_change_no_bit(
    messages: list[Message], whole: tuple[Run, list[list[bytes]]], tmp_path: Path
) -> None:
    run = Run(tmp_path)
    given = []
    for message in messages:
        given.append(run.take(message))
        run.checkpoints.write(run.state.snapshot())
        run = Run(tmp_path)
        found, complaints = run.checkpoints.newest()
        assert found is not None
        assert complaints == []
        run.state.restore(found)
    assert given == whole[1]
    assert run.bits() == whole[0].bits()
