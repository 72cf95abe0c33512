"""A new owner has caught up when a turn that began afterwards has left little."""

from queue import SimpleQueue
from threading import Thread

import pytest

from dropanchor_service.ownership import processed as module
from dropanchor_service.ownership.processed import FEW, Processed
from support.patience import PATIENCE_S


def test_it_waits_for_two_turns_that_leave_little(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "TURN_S", 60.0)
    depth, woken = [FEW], SimpleQueue[None]()
    processed = Processed(lambda: depth[0], lambda: woken.put(None))
    waiting = Thread(target=processed.wait)
    waiting.start()
    woken.get(timeout=PATIENCE_S)
    processed.between_turns()
    assert woken.empty()
    depth[0] = FEW - 1
    processed.between_turns()  # it may have begun before the wait
    woken.get(timeout=PATIENCE_S)
    assert waiting.is_alive()
    processed.between_turns()
    waiting.join(PATIENCE_S)
    assert not waiting.is_alive()
