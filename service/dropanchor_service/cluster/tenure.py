"""Whether the owner of a bucket may go on. Pure: no I/O, and no clock but the one that is passed in."""

from collections.abc import Callable
from enum import Enum
from threading import Lock

from dropanchor_schemas.sentences import say

HAND_OVER_S = 10.0  # that a successor has before the former owner leaves
GIVE_UP_S = 10.0  # in doubt: then the process ends, and its restart begins as a standby
FROZEN = 0.5  # of the lease: a longer pause between two ticks means that this process did not run


class Standing(Enum):
    """How sure a process is that it owns its bucket."""

    OWNER = "owner"
    ALONE = "owner while the database is away"
    LEAVING = "owner until its successor is ready"
    IN_DOUBT = "silent, because another process may own the bucket"
    LOST = "no longer the owner"


class Tenure:
    """What one process knows of its lease of one epoch. Thread-safe.

    The lease counts from before the request that renewed it, so it ends here before anybody else sees its end. While
    the database is away nobody can take over either, so the owner goes on, as long as it ran all the time and would
    hear of an owner with a higher epoch. now_s: a clock that goes on while the machine is suspended. hears_others:
    returns whether the liveliness tokens of other owners reach this process.
    """

    def __init__(
        self, epoch: int, lease_s: float, now_s: Callable[[], float], hears_others: Callable[[], bool], asked_s: float
    ) -> None:
        self.epoch = epoch
        self.why_lost = ""
        self._highest = epoch  # of the owners that were seen alive
        self._lease_s = lease_s
        self._now_s = now_s
        self._hears_others = hears_others
        self._renewed_s = self._ticked_s = asked_s
        self._leaves_s: float | None = None
        self._in_doubt_since_s: float | None = None
        self._lock = Lock()

    @property
    def standing(self) -> Standing:
        with self._lock:
            return self._judge()

    @property
    def may_serve(self) -> bool:
        """Return whether poses may leave this process now."""
        return self.standing not in (Standing.IN_DOUBT, Standing.LOST)

    @property
    def age_s(self) -> float:
        """Return the seconds since the lease was renewed."""
        return self._now_s() - self._renewed_s

    def tick(self) -> None:
        """Note that this process runs. Call it several times per lease, on a thread that never waits for others."""
        with self._lock:
            self._judge()
            self._ticked_s = self._now_s()

    def renewed(self, asked_s: float) -> None:
        """Note that the database has renewed the lease. asked_s: when it was asked to."""
        with self._lock:
            self._renewed_s, self._in_doubt_since_s = asked_s, None
            self._ticked_s = self._now_s()

    def hand_over(self) -> None:
        """Go on until a token of a higher epoch appears, because the successor was asked to take over."""
        with self._lock:
            if self._leaves_s is None:
                self._leaves_s = self._now_s() + HAND_OVER_S

    def saw_epoch(self, epoch: int) -> None:
        """Note that an owner with this epoch is alive. While the database renews the lease, only that counts."""
        with self._lock:
            self._highest = max(self._highest, epoch)

    def lose(self, why: str) -> None:
        """Note that this process owns the bucket no longer. why: a sentence without its full stop."""
        with self._lock:
            self.why_lost = self.why_lost or why

    def _judge(self) -> Standing:
        now_s = self._now_s()
        if not self.why_lost and self._leaves_s is not None and now_s > self._leaves_s:
            self.why_lost = say("handed_over", "it was handed over {seconds} s ago", seconds=f"{HAND_OVER_S:.0f}")
        has_lease = self._leaves_s is None and now_s - self._renewed_s <= self._lease_s
        if not self.why_lost and not has_lease and self._highest > self.epoch:
            self.why_lost = say("higher_epoch", "an owner with the higher epoch {epoch} is alive", epoch=self._highest)
        if self.why_lost:
            return Standing.LOST
        if self._leaves_s is not None:
            return Standing.LEAVING
        if has_lease:
            return Standing.OWNER
        if now_s - self._ticked_s > FROZEN * self._lease_s and self._in_doubt_since_s is None:
            self._in_doubt_since_s = now_s
        if self._in_doubt_since_s is None:
            return Standing.ALONE if self._hears_others() else Standing.IN_DOUBT
        if now_s - self._in_doubt_since_s > GIVE_UP_S:
            self.why_lost = say(
                "gave_up",
                "this process did not run for a while, and the database has not answered for {seconds} s",
                seconds=GIVE_UP_S,
            )
            return Standing.LOST
        return Standing.IN_DOUBT
