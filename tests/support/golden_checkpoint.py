"""The checkpoint that the tests of migrations start from: three tags, in the middle of a drive.

Before the layout changes, `python -m support.golden_checkpoint FILE` writes the one of the present layout.
"""

import lzma
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from dropanchor_service.checkpoints.format import encoded
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.recording_engine import RecordingEngine
from support.traffic import Message, known_starts, traffic

GOLDEN = Path(__file__).parents[1] / "service" / "checkpoints" / "golden"
TAGS, SECONDS, SEED = 3, 8.0, 4
_FOR_NUMBERS = {"id": lzma.FILTER_LZMA2, "preset": 9, "lc": 0, "lp": 3, "pb": 3}  # of eight bytes each


class Drive:
    """A service without threads or network. Tag 0 begins with many hypotheses."""

    def __init__(self, folder: Path) -> None:
        starts = known_starts(TAGS, SEED)
        del starts[tag_name(0)]
        self.engine = RecordingEngine()
        self.bench = IngestBench(engine=self.engine, folder=folder, tags=starts)
        self.state = self.bench.service_state()

    def send(self, messages: list[Message]) -> None:
        for message in messages:
            self.bench.put(message.tag, message.payload, at_ns=message.due_ns)
            self.bench.ingest.turn()


def halves() -> tuple[list[Message], list[Message]]:
    """Return what the tags send before and after the checkpoint."""
    messages = traffic(TAGS, SECONDS, SEED)
    return messages[: len(messages) // 2], messages[len(messages) // 2 :]


def golden(version: int) -> bytes:
    """Return the checkpoint that was written in this layout."""
    return lzma.decompress((GOLDEN / f"version-{version}.xz").read_bytes())


def main(file: Path) -> None:
    with TemporaryDirectory() as folder:
        drive = Drive(Path(folder))
        drive.send(halves()[0])
        whole = b"".join(encoded(drive.state.snapshot(), drive.state.layout))
    file.write_bytes(lzma.compress(whole, filters=[_FOR_NUMBERS]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
