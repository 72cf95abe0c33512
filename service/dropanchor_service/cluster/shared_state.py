"""What the owner keeps in the database, so that its successor can go on: the checkpoint, and what people change.

Each write holds only while nobody has a higher epoch.
"""

from collections.abc import Callable
from threading import Lock

from dropanchor_service.checkpoints.format import AsPresent, CheckpointError, Snapshot, decoded, encoded
from dropanchor_service.cluster.database import Connection, DatabaseError, sentence_of
from dropanchor_service.cluster.leases import Claim

_CHECKPOINT = """
    UPDATE dropanchor_checkpoint SET layout = %s, written = clock_timestamp(), content = %b, object = ''
    WHERE bucket = %s AND epoch = %s
"""
_DOCUMENT = """
    INSERT INTO dropanchor_document (bucket, name, epoch, content) VALUES (%s, %s, %s, %b)
    ON CONFLICT (bucket, name) DO UPDATE SET content = excluded.content, epoch = excluded.epoch
    WHERE dropanchor_document.epoch <= excluded.epoch
"""


class CheckpointRow:
    """The checkpoint of a bucket, in the database.

    connect: raises DatabaseError. layout: in which it is written.
    """

    def __init__(self, connect: Callable[[], Connection], bucket: str, layout: str, as_present: AsPresent) -> None:
        self.layout = layout
        self._connect = connect
        self._bucket = bucket
        self._as_present = as_present
        self._connection: Connection | None = None
        self._claim = Claim(0, b"", {})
        self._lock = Lock()

    def own(self, claim: Claim) -> None:
        """Go on from what the claim has, and write with its epoch."""
        self._claim = claim

    def write(self, snapshot: Snapshot) -> int:
        """Write the checkpoint; see `Checkpoints`."""
        if not self._lock.acquire(blocking=False):
            raise CheckpointError("the database has not answered the write before this one")
        try:
            return self._write(b"".join(encoded(snapshot, self.layout)))
        finally:
            self._lock.release()

    def _write(self, content: bytes) -> int:
        try:
            if self._connection is None or self._connection.closed:
                self._connection = self._connect()
            values = [self.layout, content, self._bucket, self._claim.epoch]
            written = self._connection.execute(_CHECKPOINT, values, binary=True).rowcount
        except DatabaseError as error:
            self._disconnect()
            raise CheckpointError(f"the database does not take it: {sentence_of(error)}") from error
        if written != 1:
            raise CheckpointError(f"another process owns the bucket {self._bucket}, or its row is gone")
        return len(content)

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the snapshot that the claim came with; see `Checkpoints`."""
        if not self._claim.checkpoint:
            named = self._claim.object
            return None, [f"the checkpoint {named} is not used: cluster.checkpoints is not set"] if named else []
        try:
            return self._as_present(*decoded(self._claim.checkpoint)), []
        except CheckpointError as error:
            return None, [f"the checkpoint of the bucket {self._bucket} is not used: {error}"]

    def close(self) -> None:
        """Disconnect, unless a write waits for the database."""
        if not self._lock.locked():
            self._disconnect()

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def save_document(connect: Callable[[], Connection], bucket: str, epoch: int, name: str, content: bytes) -> None:
    """Save a document. Raises OSError, so that whoever changed it hears of it."""
    try:
        with connect() as connection:
            connection.execute("SET synchronous_commit = on")
            if connection.execute(_DOCUMENT, [bucket, name, epoch, content]).rowcount == 1:
                return
    except DatabaseError as error:
        raise OSError(f"the database of the cluster does not take it: {sentence_of(error)}") from error
    raise OSError(f"another process owns the bucket {bucket}")
