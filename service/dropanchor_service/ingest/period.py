"""How long the ingest gathers messages between two turns.

A turn costs nearly as much with one message as with fifty. While few messages arrive, turns lie further apart, but no
more than three quarters of the time for which tags gather samples before they send them. Messages are gathered before,
too: both together stay below 0.2 s.
"""

ENOUGH = 50  # messages of a turn, from which on a longer period saves little
OF_SPAN = 0.75  # limit of the period, as a share of the time for which tags gather samples
GROWTH, LONGEST_S = 7.5, 0.15  # more limits of it: so many times the shortest one, and this long
GATHERING, GATHERING_S = 0.2, 0.03  # share of the period for which arriving messages are gathered, and its limit


class Period:
    """shortest_s: the period while many messages arrive, or messages that hold samples of a short time.

    current_s: the period now.
    """

    def __init__(self, shortest_s: float) -> None:
        self._shortest_s = self.current_s = shortest_s
        self._longest_s = max(shortest_s, min(GROWTH * shortest_s, LONGEST_S))

    def adapt(self, messages: int, elapsed_s: float, span_s: float) -> None:
        """Follow a turn.

        messages: that it took. elapsed_s: since the turn before. span_s: between the oldest and the newest sample of a
        message, the least of this turn.
        """
        if messages:
            wanted_s = min(elapsed_s * ENOUGH / messages, OF_SPAN * span_s, self._longest_s)
            self.current_s = max(wanted_s, self._shortest_s)

    @property
    def gathering_s(self) -> float:
        """How long arriving messages are gathered before they get their arrival times, which are wrong by so much."""
        return min(GATHERING * self.current_s, GATHERING_S)
