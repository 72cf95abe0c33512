"""The tags that have been heard or configured, and the row that each one has."""

from collections import Counter
from dataclasses import dataclass, field
from threading import Lock


@dataclass
class Tag:
    """One tag. Counters are written by the ingest thread only."""

    name: str
    row: int
    first_heard_ns: int | None = None
    last_heard_ns: int | None = None
    online: bool = False
    samples: Counter[str] = field(default_factory=Counter)  # by kind
    rejected: Counter[str] = field(default_factory=Counter)  # by reason


class TagTable:
    """Names and rows. Rows are dense, given in order of registration, and never reused."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._by_name: dict[str, Tag] = {}
        self._by_row: list[Tag] = []

    def __len__(self) -> int:
        return len(self._by_row)

    def find(self, name: str) -> Tag | None:
        return self._by_name.get(name)

    def at(self, row: int) -> Tag:
        """Raises IndexError for a row that was never given."""
        return self._by_row[row]

    def all(self) -> list[Tag]:
        return self._by_row[:]

    def register(self, name: str) -> Tag:
        """The tag of this name, made when it is new."""
        with self._lock:
            tag = self._by_name.get(name)
            if tag is None:
                tag = Tag(name, len(self._by_row))
                self._by_row.append(tag)
                self._by_name[name] = tag
            return tag
