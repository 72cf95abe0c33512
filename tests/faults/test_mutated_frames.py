"""Bad input is counted by reason: mutated frames raise no error, and every frame and sample is accounted for."""

import os
import random
from collections import Counter

from dropanchor_schemas.wire import Rejection, decode_packed
from support.ingest import IngestBench
from support.traffic import traffic

FRAMES = int(os.environ.get("DROPANCHOR_MUTATED_FRAMES", "60000"))
TAGS = 20
IN_ONE_TURN = 1000


def test_mutated_frames_raise_no_error_and_the_counts_add_up() -> None:
    seeds = [message.payload for message in traffic(TAGS, 10.0, seed=9, step_s=0.05)]
    dice = random.Random(9)
    bench = IngestBench(max_tags=TAGS)
    refused: Counter[str] = Counter()
    offered = 0
    for start in range(0, FRAMES, IN_ONE_TURN):
        payloads = [mutated(dice, seeds) for _ in range(IN_ONE_TURN)]
        for index, payload in enumerate(payloads):
            frame = decode_packed(payload)
            if isinstance(frame, Rejection):
                refused[frame.reason] += 1
            else:
                offered += len(frame)
            bench.put(f"tag-{(start + index) % TAGS}", payload)
        while bench.buffer.depth:
            bench.ingest.turn()
    rejected = bench.rejected()
    for reason, frames in refused.items():  # a time is refused in a frame, and in a sample whose clock was corrected
        assert rejected[reason] == frames or (reason == "time_out_of_range" and rejected[reason] > frames)
    assert min(refused.values()) > 0
    assert len(refused) >= 6
    fused = bench.total(bench.metrics.samples)
    given = rejected.get("sensor_fault", 0)  # what fails the check of the sensors is a sample that was given to it
    lost = sum(rejected.values()) - given - sum(refused.values())
    assert fused + lost == offered
    assert 0 < lost < offered
    assert bench.total(bench.metrics.messages) == start + IN_ONE_TURN
    assert not bench.faults()


def test_a_frame_of_a_future_version_is_rejected_by_reason() -> None:
    payload = bytearray(traffic(1, 1.0, seed=9)[0].payload)
    payload[0] += 1
    bench = IngestBench()
    bench.send("forward", bytes(payload))
    assert bench.rejected() == {"version_unknown": 1}


def mutated(dice: random.Random, seeds: list[bytes]) -> bytes:
    """Return a valid payload with up to three changed bytes, sometimes cut off. Boot id 0 avoids duplicates."""
    payload = bytearray(dice.choice(seeds))
    payload[12:16] = bytes(4)
    for _ in range(dice.randrange(4)):
        at = dice.randrange(32 if dice.random() < 0.5 else len(payload))
        if not 12 <= at < 16:
            payload[at] = dice.randrange(256)
    if dice.random() < 0.2:
        del payload[dice.randrange(len(payload)) :]
    return bytes(payload)
