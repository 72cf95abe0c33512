"""Checkpoints as objects that all machines reach. The row of the bucket in the database says which one holds.

An object is never replaced: its name begins with the epoch of its writer and ends with a random number. A former owner
may still write one, but cannot name it in the row, which is of a higher epoch by then.
"""

import secrets
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from dropanchor_service.checkpoints.format import AsPresent, CheckpointError, Snapshot, decoded, encoded, size_of
from dropanchor_service.cluster.database import Connection, DatabaseError, sentence_of
from dropanchor_service.cluster.leases import Claim

if TYPE_CHECKING:
    from dropanchor_service.checkpoints.objects import ObjectFolder  # it needs an extra

KEPT = 2  # the one that holds, and the one before it
READ_S = 10.0  # for a store that does not answer, before all tags start afresh
RETRY_S = 0.5
_NAME = """
    UPDATE dropanchor_checkpoint
    SET layout = %s, written = clock_timestamp(), content = '', object = %s, bytes = %s
    WHERE bucket = %s AND epoch = %s
"""


class CheckpointObjects:
    """The checkpoints of a bucket, as objects; see `Checkpoints`.

    connect: raises DatabaseError. layout: in which they are written. Not thread-safe.
    """

    def __init__(
        self, connect: Callable[[], Connection], bucket: str, folder: "ObjectFolder", layout: str, as_present: AsPresent
    ) -> None:
        self.layout = layout
        self._connect = connect
        self._bucket = bucket
        self._folder = folder
        self._as_present = as_present
        self._connection: Connection | None = None
        self._claim = Claim(0, b"", {})
        self._written = 0
        self._kept: list[str] = []  # own ones, and the one to go on from; the newest is the last

    def own(self, claim: Claim) -> None:
        """Go on from what the claim has, and write with its epoch."""
        self._claim = claim
        self._kept = [claim.object] if claim.object else []

    def write(self, snapshot: Snapshot) -> int:
        """Write the checkpoint, and name it in the row; see `Checkpoints`."""
        parts = encoded(snapshot, self.layout)
        size = size_of(parts)
        number = f"{self._claim.epoch:012d}-{self._written + 1:012d}-{secrets.token_hex(4)}"
        name = f"{self._bucket}/{number}"
        self._folder.write(name, parts)
        try:
            self._point_at(name, size)
        except CheckpointError:
            with suppress(CheckpointError):
                self._folder.delete(name)
            raise
        self._written += 1
        self._kept.append(name)
        with suppress(CheckpointError):
            self._tidy()
        return size

    def _point_at(self, name: str, size: int) -> None:
        """Let the row name this object, unless another process owns the bucket. Raises CheckpointError."""
        try:
            if self._connection is None or self._connection.closed:
                self._connection = self._connect()
            values = [self.layout, name, size, self._bucket, self._claim.epoch]
            written = self._connection.execute(_NAME, values).rowcount
        except DatabaseError as error:
            self.close()
            raise CheckpointError(f"the database does not take its name: {sentence_of(error)}") from error
        if written != 1:
            raise CheckpointError(f"another process owns the bucket {self._bucket}, or its row is gone")

    def _tidy(self) -> None:
        """Delete what nobody goes on from: own ones that are too old, and once what former owners have left."""
        if self._written == 1:
            for name in self._folder.names(self._bucket):
                if name not in self._kept and _epoch(name) < self._claim.epoch:
                    self._folder.delete(name)
        while len(self._kept) > KEPT:
            self._folder.delete(self._kept[0])
            del self._kept[0]

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the snapshot that the row names, or holds, or the one before it; see `Checkpoints`."""
        if self._claim.checkpoint:  # of a time when the row held it
            return self._first_usable([("the checkpoint in the database", self._claim.checkpoint)])
        end_s = time.monotonic() + READ_S
        while self._claim.object:
            try:
                return self._first_usable(self._contents())
            except CheckpointError as error:
                if time.monotonic() > end_s:
                    return None, [f"the checkpoint {self._claim.object} is not used: {error}"]
                time.sleep(RETRY_S)
        return None, []

    def _contents(self) -> Iterator[tuple[str, bytes | None]]:
        """Give the object that the row names, and then earlier ones, each with its content. Raises CheckpointError."""
        named = self._claim.object
        yield named, self._folder.read(named)
        for name in sorted(self._folder.names(self._bucket), reverse=True):
            if name < named:
                yield name, self._folder.read(name)

    def _first_usable(self, contents: Iterable[tuple[str, bytes | None]]) -> tuple[Snapshot | None, list[str]]:
        complaints: list[str] = []
        for name, content in contents:
            if content is None:
                complaints.append(f"{name} is not used: {self._folder.url} does not have it")
                continue
            try:
                return self._as_present(*decoded(content)), complaints
            except CheckpointError as error:
                complaints.append(f"{name} is not used: {error}")
        return None, complaints

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def _epoch(name: str) -> int:
    first = name.rpartition("/")[2].partition("-")[0]
    return int(first) if first.isdecimal() else 0
