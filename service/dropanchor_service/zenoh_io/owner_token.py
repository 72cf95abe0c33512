"""The liveliness token of the owner of a bucket, and those of other owners."""

from collections.abc import Callable
from typing import Any, Self

import zenoh

from dropanchor_schemas import keys


class ZenohOwner:
    """Tells of the tokens of other owners while it is open, and shows its own one from `announce` on.

    The token of a successor says that it serves, so that the former owner can leave.
    """

    def __init__(self, session: zenoh.Session, bucket: str, epoch: int, on_epoch: Callable[[int], None]) -> None:
        """on_epoch: called with the epoch of each owner that is alive, on a thread of Zenoh."""
        self._session = session
        self._bucket = bucket
        self._epoch = epoch
        self._on_epoch = on_epoch
        self._declared: list[Any] = []

    def __enter__(self) -> Self:
        others = self._session.liveliness().declare_subscriber(
            keys.all_owners(self._bucket), zenoh.handlers.Callback(self._on_token, indirect=False), history=True
        )
        self._declared.append(others)
        return self

    def announce(self) -> None:
        """Show the token. Not for a callback of Zenoh."""
        key = keys.owner_key(self._bucket, self._epoch)
        self._declared.append(self._session.liveliness().declare_token(key))

    def __exit__(self, *_: object) -> None:
        for declared in self._declared:
            declared.undeclare()

    def _on_token(self, message: zenoh.Sample) -> None:
        epoch = keys.epoch_from_key(str(message.key_expr))
        if message.kind == zenoh.SampleKind.PUT and epoch is not None:
            self._on_epoch(epoch)
