"""A clock that a test sets."""

from dropanchor_service.runtime.clock import UtcClock
from support.traffic import T0_NS


class ManualClock(UtcClock):
    """A host whose clock shows `t_ns`, UTC, until the test sets another time."""

    def __init__(self, t_ns: int = T0_NS) -> None:
        super().__init__()
        self.t_ns = t_ns

    def now_ns(self) -> int:
        return self.t_ns + self.correction_ns
