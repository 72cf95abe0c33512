"""Hypothesis strategies for valid frames, their payloads, and damaged payloads."""

import math
from typing import Any

from hypothesis import strategies as st

from dropanchor_schemas.kinds import IMU, KINDS, SCALARS
from dropanchor_schemas.wire import Frame, HeadingSample, ImuSample, anchor_number, encode_json, encode_packed

T = 1_760_000_000_000_000_000

times = st.integers(0, 4_000_000).map(lambda us: T + 1000 * us)
values = st.floats(width=32, allow_nan=False, allow_infinity=False)
stds = st.one_of(st.just(math.nan), st.floats(0, 1e6, width=32))
vectors = st.tuples(values, values, values)
names = st.text(st.characters(codec="utf-8"), min_size=1, max_size=8)
u32 = st.integers(0, 2**32 - 1)
anchors = st.one_of(u32, names.map(anchor_number))
samples_of = {
    kind: st.builds(kind.sample, times, *([anchors] if kind.has_anchor else []), values, stds) for kind in SCALARS
} | {IMU: st.builds(ImuSample, times, vectors, vectors, st.one_of(st.none(), vectors))}


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Draw a frame with at least one sample, as a tag would send it."""
    samples: dict[str, Any] = {kind.field: draw(st.lists(samples_of[kind], max_size=4)) for kind in KINDS}
    frame = Frame(
        **samples,
        sequence=draw(u32),
        boot_id=draw(u32),
        boot_clock=draw(st.booleans()),
        replay=draw(st.booleans()),
    )
    if not len(frame):
        frame.headings.append(HeadingSample(T, 0.0))
    return frame


payloads = st.one_of(frames().map(encode_packed), frames().map(encode_json))


@st.composite
def mutated_payloads(draw: st.DrawFn) -> bytes:
    """Draw a valid payload and flip bits, cut off its end, splice in a piece of another one, or repeat it."""
    payload = bytearray(draw(payloads))
    match draw(st.sampled_from(["flip", "cut", "splice", "repeat"])):
        case "flip":
            for position in draw(st.lists(st.integers(0, 8 * len(payload) - 1), min_size=1, max_size=8)):
                payload[position // 8] ^= 1 << position % 8
        case "cut":
            del payload[draw(st.integers(0, len(payload) - 1)) :]
        case "splice":
            other, at = draw(payloads), draw(st.integers(0, len(payload)))
            payload[at : at + draw(st.integers(0, 40))] = other[: draw(st.integers(0, len(other)))]
        case "repeat":
            payload *= draw(st.integers(2, 3))
    return bytes(payload)
