"""What an engine is, and what some engines can do beside."""

from typing import Protocol, runtime_checkable

from dropanchor_service.estimation.columns import Array, PoseBatch, SampleBatch


class Engine(Protocol):
    """One estimator per row. An engine is not thread-safe: one thread owns it."""

    name: str

    def set_anchors(self, anchors: Array) -> None:
        """Set ANCHOR, which the `anchor` columns of samples index. Existing indices keep their meaning."""

    def configure(self, row: int, settings: Array) -> None:
        """Make `row` (0, 1, 2, …) with these TAG_SETTINGS (0-d), or start it again with new ones."""

    def process(self, samples: SampleBatch) -> PoseBatch:
        """Fuse the samples. Their rows must be configured."""


@runtime_checkable
class Restorable(Protocol):
    """An engine whose state can be saved. After `restore` it gives the same poses to the last bit."""

    def state(self) -> dict[str, Array]:
        """Return all that samples have changed, to be copied before the next call.

        Names and dtypes are the same for every state of one version.
        """

    def restore(self, state: dict[str, Array]) -> None:
        """Take over what `state` returned. The engine must not have processed any sample."""


@runtime_checkable
class DeniesStarts(Protocol):
    """An engine that gives a start up when ranges contradict it."""

    def are_at_start(self, rows: Array) -> Array:
        """Return whether each of the rows still follows the start in its settings."""


@runtime_checkable
class FollowsAnchors(Protocol):
    """An engine whose tracks go on when somebody corrects the place of an anchor."""

    def move_anchors(self, anchors: Array) -> Array:
        """Set ANCHOR, and let the tracks follow those that moved. Return the rows that have to start afresh."""


@runtime_checkable
class FollowsPressure(Protocol):
    """An engine that takes the weather out of pressures."""

    def refer(self, row: int, reference: int) -> None:
        """Compare the pressures of `row` with those of the row `reference`, -1: none. Its estimate goes on."""
