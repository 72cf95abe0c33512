"""The tag whose barometer stays where it is takes the weather out of the pressures of its own site, and of no other."""

from typing import Any

import numpy as np

from dropanchor_schemas.kinds import PressureSample
from dropanchor_schemas.site import TagSettings
from dropanchor_schemas.wire import Frame, encode_packed
from dropanchor_service.estimation.columns import Array
from support.ingest import IngestBench, TransparentEngine

T = 1_760_000_000_000_000_000


class ReferringEngine(TransparentEngine):
    """Notes which row each row refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.references: dict[int, int] = {}

    def configure(self, row: int, settings: Array) -> None:
        super().configure(row, settings)
        self.references.pop(row, None)

    def refer(self, row: int, reference: int) -> None:
        self.references[row] = reference


def bench_with(tags: dict[str, Any]) -> tuple[IngestBench, ReferringEngine]:
    engine = ReferringEngine()
    return IngestBench(engine=engine, tags=tags), engine


def send(bench: IngestBench, tag: str) -> int:
    bench.send(tag, encode_packed(Frame(pressures=[PressureSample(T, 101_325.0)])))
    found = bench.tags.find(tag)
    assert found is not None
    return found.row


def test_every_tag_refers_to_the_reference_whichever_comes_first() -> None:
    bench, engine = bench_with({"mast": {"height_motion": "reference", "height_m": 3.0}})
    cart, mast, drone = (send(bench, tag) for tag in ("cart", "mast", "drone"))
    assert engine.references == {cart: mast, drone: mast}
    assert [one.pressures["pressure"].tolist() for one in engine.batches] == [[101_325.0]] * 3
    assert all(np.isnan(one.pressures["temperature"]).all() for one in engine.batches)


def test_a_tag_that_is_no_longer_a_reference_refers_to_none() -> None:
    bench, engine = bench_with({"mast": {"height_motion": "reference"}})
    cart, mast = send(bench, "cart"), send(bench, "mast")
    bench.site.set_tag("mast", TagSettings(height_motion="free"))
    bench.ingest.turn()
    drone = send(bench, "drone")
    assert engine.references == {cart: mast, mast: -1, drone: -1}
