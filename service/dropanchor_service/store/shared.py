"""What people change over REST, and where it is saved: in a file, or where other processes find it."""

from collections.abc import Callable
from typing import Protocol

Save = Callable[[bytes], None]
"""Saves a new content. Raises OSError."""


class Shared(Protocol):
    """A document that is saved with every change."""

    def share(self, saved: bytes | None, save: Save) -> None:
        """Go on from what another process has saved, and save further changes where it did.

        saved: None if nobody has saved it yet. What this process has saved alone is then saved for all. Call this
        before anything changes. Raises OSError or pydantic's ValidationError.
        """
