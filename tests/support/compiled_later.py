"""A program that prints, as a JSON list, what is compiled or imported only after the warm-up, while samples arrive."""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numba.core.dispatcher import Dispatcher

from dropanchor_service.answers.answers import Answers
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.engines.warm_up import warm_up, warm_up_answers
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.ingest import IngestBench
from support.traffic import Message, traffic

TAGS, DURATION_S = 4, 12.0
SLOW = ("scipy.linalg", "filterpy")  # modules that are slow to import


def main() -> None:
    # The last tag leaves out whole seconds.
    messages = [m for m in traffic(TAGS, DURATION_S, 1, 0.05) if m.tag[-1:] != "3" or int(m.due_ns / 1e9) % 3]
    half = len(messages) // 2
    with TemporaryDirectory() as folder:
        before = _bench(Path(folder) / "before")  # does what every service does at its start
        warm_up(FleetEngine())
        warm_up_answers()
        warmed_up = _signatures()
        _send(before, messages[:half])
        state, after = before.service_state(), _bench(Path(folder) / "after")
        checkpoints = CheckpointFolder(Path(folder) / "checkpoints", state.layout, state.as_present)
        checkpoints.write(state.snapshot())
        found, _ = checkpoints.newest()
        assert found is not None
        after.service_state().restore(found)
        _send(after, messages[half:])
        _answer(after)
    compiled = sorted(name for name, count in _signatures().items() if count > warmed_up.get(name, 0))
    json.dump([*compiled, *(name for name in SLOW if name in sys.modules)], sys.stdout)


def _bench(folder: Path) -> IngestBench:
    return IngestBench(folder, engine=FleetEngine(), site={"anchors": [{"id": "1"}]})


def _send(bench: IngestBench, messages: list[Message]) -> None:
    for message in messages:
        bench.put(message.tag, message.payload, at_ns=message.due_ns)
        bench.ingest.turn()


def _answer(bench: IngestBench) -> None:
    answers = Answers(bench.site, bench.tags, bench.latest)
    b"".join(answers.pose_list_json())
    answers.pose_of(bench.tags.rows.at(0))
    answers.frame_of(answers.rows(), answers.now_ns())


def _signatures() -> dict[str, int]:
    """Return, for each compiled function, the number of its compiled signatures."""
    modules = [module for name, module in sys.modules.items() if name.startswith("dropanchor_service")]
    found: list[Any] = [value for module in modules for value in vars(module).values() if isinstance(value, Dispatcher)]
    return {
        f"{function.py_func.__module__}.{function.py_func.__name__}": len(function.signatures) for function in found
    }


if __name__ == "__main__":
    main()
