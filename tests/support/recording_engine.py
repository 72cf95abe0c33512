"""A fleet engine that keeps what it returned."""

from collections.abc import Callable

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, PoseBatch, SampleBatch
from dropanchor_service.estimation.fleet.engine import FleetEngine


class RecordingEngine(FleetEngine):
    """Keep a copy of every batch that the engine returned, and raise an error for the samples that `fails` selects."""

    def __init__(self, fails: Callable[[SampleBatch], bool] = lambda _: False) -> None:
        super().__init__()
        self.batches: list[PoseBatch] = []
        self._fails = fails

    def process(self, samples: SampleBatch) -> PoseBatch:
        if self._fails(samples):
            raise FloatingPointError("injected by the test")
        batch = super().process(samples)
        self.batches.append(PoseBatch(batch.poses.copy(), batch.hypotheses.copy(), batch.innovations.copy()))
        return batch

    def poses(self) -> Array:
        """Return the poses of all batches so far; (n,) POSE."""
        return np.concatenate([np.zeros(0, POSE), *(batch.poses for batch in self.batches)])
