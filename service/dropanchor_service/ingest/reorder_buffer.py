"""Keep messages that wait for one numbered before them."""

from dropanchor_service.ingest.backlog import Message, moved


class ReorderBuffer:
    """Messages behind a gap in the numbers of their publisher.

    The caller bounds the time that they wait, and their size when `is_full`.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._messages: list[Message] = []
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def is_full(self) -> bool:
        """Return whether the messages exceed the capacity, so that none should wait any longer."""
        return self._bytes > self._max_bytes

    def add(self, messages: list[Message]) -> None:
        """Add messages, the oldest first."""
        self._messages += messages
        self._bytes += sum(len(message[1]) for message in messages)

    def move_arrivals(self, by_ns: int) -> None:
        """Follow the service's clock, which was moved."""
        self._messages = list(moved(self._messages, by_ns))

    def take_due(self, others: list[Message], due_ns: int) -> list[Message]:
        """Take out all messages of the rows that have a message in `others`, or one that arrived by `due_ns`.

        They are in the order of arrival.
        """
        if not self._messages:
            return []
        rows, _, _, arrivals = zip(*self._messages, strict=True)
        due_rows = {message[0] for message in others}
        due_rows.update(row for row, arrival_ns in zip(rows, arrivals, strict=True) if arrival_ns <= due_ns)
        taken = [message for message in self._messages if message[0] in due_rows]
        if taken:
            self._messages = [message for message in self._messages if message[0] not in due_rows]
            self._bytes -= sum(len(message[1]) for message in taken)
        return taken
