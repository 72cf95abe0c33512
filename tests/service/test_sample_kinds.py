"""Every kind of sample passes from a payload to the engine. A failure says which file does not know the kind yet."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.kinds import IMU, KINDS, SCALARS, Frame, ImuSample, Kind, ScalarKind
from dropanchor_schemas.wire import COUNTS_AT, ENCODING_JSON, ENCODING_PACKED, encode_json, encode_packed
from dropanchor_service.estimation.columns import SampleBatch
from support.ingest import IngestBench

README = (Path(__file__).parents[2] / "schemas" / "README.md").read_text()
T = 1_760_000_000_000_000_000


def frame_of(kind: Kind, value: float | None = None) -> Frame:
    """Return a frame with one sample. value: of a kind that measures one number; else amid its limits."""
    frame = Frame()
    sample: Any = ImuSample(T, (0.0, 0.0, 9.75), (0.0, 0.0, 0.125))
    if isinstance(kind, ScalarKind):
        chosen = sum(kind.limits) / 2 if value is None else value
        sample = kind.sample(*([T, 7] if kind.has_anchor else [T]), chosen, kind.second_limits[1] / 2)
    getattr(frame, kind.field).append(sample)
    return frame


def test_the_columns_of_the_engine_are_those_of_the_kinds() -> None:
    columns = [field.name for field in fields(SampleBatch)]
    assert columns == [kind.field for kind in KINDS], (
        "SampleBatch in service/dropanchor_service/estimation/columns.py needs one column for each of KINDS, in order"
    )
    for kind, column in zip(SCALARS, SampleBatch().columns()[1:], strict=True):
        expected = ["row", "t_ns", *(["anchor"] if kind.has_anchor else [])]
        assert list(column.dtype.names or ())[:-2] == expected, (
            f"the column {kind.field} in estimation/columns.py has {expected}, then its two numbers"
        )


def test_the_header_has_room_for_the_counts_of_all_kinds() -> None:
    assert len(KINDS) <= len(COUNTS_AT), "COUNTS_AT in schemas/dropanchor_schemas/wire.py has no count left for a kind"


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_is_in_the_frame_and_in_the_description_of_the_wire(kind: Kind) -> None:
    assert kind.field in vars(Frame()), f"Frame in schemas/dropanchor_schemas/kinds.py needs a list {kind.field}"
    name = "IMU" if kind is IMU else kind.name
    for row in (f"| {name} | {kind.record.size} |", f"| `{kind.name}[]` |"):
        assert row in README, f"a table in schemas/README.md needs a row that begins: {row}"


@pytest.mark.parametrize("encoding", [ENCODING_PACKED, ENCODING_JSON])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_sample_of_every_kind_reaches_the_engine_and_is_counted(kind: Kind, encoding: str) -> None:
    frame = frame_of(kind)
    bench = IngestBench(site={"anchors": [{"id": "7"}]})
    bench.put("a", encode_packed(frame) if encoding == ENCODING_PACKED else encode_json(frame), encoding)
    bench.ingest.turn()
    tag = bench.tags.find("a")
    assert tag is not None
    assert (tag.samples, tag.rejected) == ({kind.name: 1}, {})
    (batch,) = bench.engine.batches
    assert [len(column) for column in batch.columns()] == [int(other is kind) for other in KINDS]
    column = batch.columns()[KINDS.index(kind)]
    assert (column["row"][0], column["t_ns"][0]) == (tag.row, T)
    if isinstance(kind, ScalarKind):
        sent = getattr(frame, kind.field)[0]
        assert column[0].tolist()[-2:] == pytest.approx(sent[-2:])


@pytest.mark.parametrize("kind", SCALARS, ids=lambda kind: kind.name)
def test_values_outside_the_limits_of_a_kind_are_rejected(kind: ScalarKind) -> None:
    bench = IngestBench()
    low, high = kind.limits
    for value, reason in ((low - 1.0, kind.below), (high * 1.01, kind.above), (np.nan, "not_finite")):
        bench.send(str(value), encode_packed(frame_of(kind, value)))
        tag = bench.tags.find(str(value))
        assert tag is not None
        assert (tag.samples, tag.rejected) == ({}, {reason: 1})
