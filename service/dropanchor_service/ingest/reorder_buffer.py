"""Messages that wait for one before them."""

from dropanchor_service.ingest.buffer import Message


class ReorderBuffer:
    """Put aside behind a gap in their publisher's numbers. Bounded in time by who wakes them, in bytes by `is_full`."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._messages: list[Message] = []
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def is_full(self) -> bool:
        """Nobody should wait any longer."""
        return self._bytes > self._most_bytes

    def add(self, messages: list[Message]) -> None:
        self._messages += messages
        self._bytes += sum(len(message[1]) for message in messages)

    def take_due(self, others: list[Message], due_ns: int) -> list[Message]:
        """Take out, in order of arrival, all of the rows that `others` are of or that have one from until `due_ns`."""
        if not self._messages:
            return []
        rows, _, _, arrivals = zip(*self._messages, strict=True)
        awake = {message[0] for message in others}
        awake.update(row for row, arrival_ns in zip(rows, arrivals, strict=True) if arrival_ns <= due_ns)
        taken = [message for message in self._messages if message[0] in awake]
        if taken:
            self._messages = [message for message in self._messages if message[0] not in awake]
            self._bytes -= sum(len(message[1]) for message in taken)
        return taken
