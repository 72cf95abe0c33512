"""A worker runs from start to stop."""

import threading

from dropanchor_service.runtime.worker import Worker


class Waits(Worker):
    """Waits for the stop, or for `freed` if it is stuck."""

    def __init__(self, *, is_stuck: bool) -> None:
        super().__init__("waits", stop_s=0.01 if is_stuck else 10.0)
        self._is_stuck = is_stuck
        self.freed = threading.Event()

    def _run(self) -> None:
        (self.freed if self._is_stuck else self._stop).wait(30.0)


def test_a_worker_lives_while_its_context_is_open() -> None:
    worker = Waits(is_stuck=False)
    assert not worker.is_alive
    with worker:
        assert worker.is_alive
    assert not worker.is_alive


def test_a_worker_that_is_stuck_does_not_hold_up_the_stop() -> None:
    with Waits(is_stuck=True) as worker:
        pass
    assert worker.is_alive
    worker.freed.set()
