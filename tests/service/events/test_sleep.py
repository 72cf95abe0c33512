"""The thread of events sleeps while nothing changes and no rule waits for a time to pass."""

import time

from dropanchor_schemas.zones import Circle, TooCloseRule, Zone
from dropanchor_service.events.thread import PRUNE_S
from dropanchor_service.store.starts import StartNews, StartPhase
from support.events import EventBench
from support.zenoh_router import wait_until

SLEEPS_S = 0.4  # four periods of the thread


class CountingTurns:
    """Counts the turns of the thread of a bench."""

    def __init__(self, bench: EventBench) -> None:
        self.count = 0
        self._turn = bench.thread.turn
        bench.thread.turn = self.turn  # type: ignore[method-assign]

    def turn(self) -> None:
        self._turn()
        self.count += 1

    def in_a_while(self) -> int:
        """Return how many turns there are in four periods."""
        before = self.count
        time.sleep(SLEEPS_S)
        return self.count - before


def test_turns_follow_poses_and_edits_and_go_on_while_a_rule_needs_time() -> None:
    bench = EventBench()
    turns = CountingTurns(bench)
    with bench.thread:
        wait_until(lambda: turns.count == 1)
        assert turns.in_a_while() == 0
        bench.poses.move("cart", x=1.0)
        assert turns.in_a_while() == 0  # there is nothing to judge poses by
        before = turns.count
        bench.put(Zone(id="a", shape=Circle(type="circle", x=0.0, y=0.0, radius_m=9.0)))
        wait_until(lambda: turns.count > before)
        assert turns.in_a_while() <= 1
        before = turns.count
        bench.poses.move("cart", x=2.0)
        wait_until(lambda: turns.count > before)
        bench.put(rules=[TooCloseRule(id="a", type="too_close", distance_m=9.0, delay_s=0.0)])
        wait_until(lambda: turns.in_a_while() >= 2)


def test_what_becomes_of_a_start_wakes_the_thread_though_no_pose_changes() -> None:
    bench = EventBench()
    turns = CountingTurns(bench)
    bench.poses.move("cart", x=1.0)
    with bench.thread:
        wait_until(lambda: turns.count == 1)
        bench.poses.answers.tags.rows.start_news.append(StartNews(0, StartPhase.TOLD))
        wait_until(lambda: turns.count == 2, PRUNE_S / 2)  # then it would wake by itself
