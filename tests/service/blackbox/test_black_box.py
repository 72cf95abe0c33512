"""Any moment in the black box can be run again, whatever kills, full disks and damage have left of it."""

import json
import subprocess
import sys
from collections.abc import Callable
from math import dist
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.past import WhatIf
from dropanchor_schemas.site import Anchor
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, RangeSample, encode_json
from dropanchor_service.blackbox.block import Block, BoxTurn, encoded_turns
from dropanchor_service.blackbox.box import MAX_QUEUED_BYTES, PATIENT_S, BlackBox
from dropanchor_service.blackbox.chosen import BoxError
from dropanchor_service.blackbox.export import NOBODY, Sent
from dropanchor_service.blackbox.pieces import TURNS, Limits, Piece, pieces_in
from dropanchor_service.blackbox.questions import Question, answer_to
from dropanchor_service.blackbox.rerun import Rerun
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.recording.reading import RecordingReader
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client.simulator.live import simulation
from dropanchor_tag_client.simulator.sensors import preset
from service.data_folder import full_disk
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, known_starts, traffic

S = 1_000_000_000
TAG, OTHER = "sim-2", "sim-1"
LIMITS = Limits(2**40, 10**18)
RUNS = ("as_was", "what_if")
RENAMED_NS, MOVED_NS, END_NS = T0_NS + 66 * S, T0_NS + 70 * S, T0_NS + 75 * S


class Boxed:
    """An ingest with a real engine and a black box, whose writing thread is `write`. now_ns: the time."""

    def __init__(self, folder: Path, tags: int = 0, limits: Limits = LIMITS, queued: int = MAX_QUEUED_BYTES) -> None:
        self.clock = ManualClock()
        options: dict[str, Any] = {"site": {"anchors": [{"id": "1"}]}, "tags": known_starts(tags, 1) if tags else {}}
        settings = load_settings(options=options, environment={})
        self.poses: list[Array] = []
        observers = Observers(lambda messages: self.box.on_messages(messages), lambda p: self.poses.append(p.copy()))
        engine = create_engine(settings) if tags else None
        self.bench = IngestBench(engine=engine, clock=self.clock, observers=observers, **options)
        state = self.bench.service_state() if tags else None
        now_ns = self.clock.now_ns
        metadata, clock = settings.of_replays, self.monotonic
        self.box = BlackBox(folder, limits, self.bench.sites, state, now_ns, metadata, clock, queued)
        self.box.between_turns(has_pending=False)

    def monotonic(self) -> float:
        return self.clock.t_ns * 1e-9

    def turn(self, t_ns: int) -> None:
        self.clock.t_ns = t_ns
        self.bench.ingest.turn()
        self.box.between_turns(self.bench.ingest.has_pending)

    def send(self, tag: str = TAG, seconds: int = 1) -> None:
        for _ in range(seconds):
            self.bench.put(tag, Frame(ranges=[RangeSample(self.clock.t_ns, 1, 9.0)]), at_ns=self.clock.t_ns)
            self.turn(self.clock.t_ns + S)

    def write(self) -> None:
        assert self.box.writer.flush()

    def own(self, tag: str) -> Array:
        found = self.bench.tags.find(tag)
        poses = np.concatenate([np.empty(0, POSE), *self.poses])
        own: Array = poses[poses["row"] == (-1 if found is None else found.row)]
        return own


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Boxed:
    """A box with 75 s of two tags. After 66 s one of them gets a name, and after 70 s the anchor is moved."""
    boxed = Boxed(tmp_path_factory.mktemp("box"), tags=2)
    messages, t_ns = traffic(2, 75.0, 1, 0.1), T0_NS
    while t_ns < END_NS:
        t_ns += S // 20
        while messages and messages[0].due_ns <= t_ns:
            message = messages.pop(0)
            boxed.bench.put(message.tag, message.payload, at_ns=message.due_ns)
        boxed.turn(t_ns)
        if t_ns == RENAMED_NS:
            boxed.bench.site.set_tag(TAG, boxed.bench.site.tag_settings(TAG).model_copy(update={"name": "Anna's cart"}))
        if t_ns == MOVED_NS:
            boxed.bench.site.set_anchor(Anchor(id="1", x=8.0))
        if t_ns % (10 * S) == 0:
            boxed.write()
    boxed.write()
    return boxed


@pytest.mark.parametrize("at_s", [30.0, 62.05, 74.9], ids=["first piece", "next piece", "after changes"])
def test_a_moment_is_run_again_to_the_last_bit(filled: Boxed, at_s: float) -> None:
    at_ns = T0_NS + round(at_s * S)
    run = Rerun(filled.box.folder, "default", TAG, at_ns, at_ns)
    run.run_to(at_ns)
    again, then = np.concatenate(run.poses), filled.own(TAG)
    then = then[(then["t_ns"] >= again["t_ns"][0]) & (then["t_ns"] <= again["t_ns"][-1])]
    assert len(again) > 100
    assert again["t_ns"][-1] > at_ns - S
    for name in POSE.names or ():
        if name != "row":
            np.testing.assert_array_equal(again[name], then[name], err_msg=name)


def test_the_explanation_of_a_moment_says_what_led_to_it_and_came_next_and_comes_from_another_process(
    filled: Boxed,
) -> None:
    at_ns = T0_NS + 40 * S
    question = Question(folder=filled.box.folder, site="default", tag=TAG, at_ns=at_ns)
    process = (sys.executable, "-P", "-m", "dropanchor_service.blackbox")
    asked = question.model_dump_json().encode()
    answer = json.loads(subprocess.run(process, input=asked, capture_output=True, check=True).stdout)["answer"]
    past, then = answer["past"], filled.own(TAG)
    newest = then[then["t_ns"] <= at_ns - S // 20][-1]
    assert abs(answer["pose"]["t_ns"] - newest["t_ns"]) <= S // 10
    assert len(answer["innovations"]) == 50
    assert past["states"][0]["state"] == "tracking"
    assert past["track"]["t_ns"][-1] == answer["pose"]["t_ns"] < past["next"]["t_ns"][0]
    assert past["next"]["t_ns"][-1] <= answer["pose"]["t_ns"] + 10 * S


def test_a_run_with_other_settings_goes_on_from_where_the_tag_was_and_changes_nothing(filled: Boxed) -> None:
    period = {"from_ns": T0_NS + 20 * S, "to_ns": T0_NS + 30 * S}
    document = filled.bench.site.document

    def asked(**changed: Any) -> dict[str, Any]:
        what = WhatIf.model_validate(period | changed)
        return answer_to(Question(folder=filled.box.folder, site="default", tag=TAG, what_if=what))

    same, moved = asked(), asked(anchors=[Anchor(id="1", x=40.0, y=25.0)])
    assert same["began_at_pose"]
    assert same["apart_m"] < 1.0
    assert moved["apart_m"] > 2.0
    first = [moved[name]["x"][0] - moved["as_was"]["x"][0] for name in ("what_if",)]
    assert abs(first[0]) < 2.0
    assert filled.bench.site.document is document


def test_a_run_without_a_change_ends_where_the_tag_truly_was_and_begins_where_it_last_knew_that(filled: Boxed) -> None:
    def asked(from_ns: int) -> dict[str, Any]:
        what = WhatIf(from_ns=from_ns, to_ns=END_NS, anchors=[Anchor(id="1")])
        return answer_to(Question(folder=filled.box.folder, site="default", tag=TAG, what_if=what))

    truth, run = simulation("yard", 1, 1, preset("calibrated"), 75.0).truth, asked(MOVED_NS - S)
    was, other = (dist([run[name][axis][-1] for axis in "xy"], (truth.x[-1], truth.y[-1])) for name in RUNS)
    assert other < 0.5 < 3.0 < was
    assert run["as_was"]["state"][-1] == "ambiguous"
    assert asked(END_NS - S)["began_at_pose"]


def test_samples_come_as_a_recording_and_as_a_table_without_names_if_nobody_shall_know_them(
    filled: Boxed, tmp_path: Path
) -> None:
    def sent(anonymous: bool) -> Sent:
        return Sent(filled.box.folder, "default", TAG, T0_NS + 64 * S, T0_NS + 68 * S, anonymous)

    for anonymous, tag in ((False, TAG), (True, NOBODY)):
        file = tmp_path / f"{tag}.mcap"
        file.write_bytes(b"".join(sent(anonymous).mcap()))
        turns = [*RecordingReader(file).turns()]
        assert {message[0] for turn in turns for message in turn.messages} == {tag}
        assert (b"Anna" in file.read_bytes() or "Anna" in str([turn.site for turn in turns])) is not anonymous
        assert OTHER not in str([turn.site for turn in turns])
        lines = b"".join(sent(anonymous).table()).decode().splitlines()
        assert sum(",range,1," in line for line in lines) == sum(len(turn.messages) for turn in turns)


def test_messages_come_back_as_they_were_by_site_and_tag() -> None:
    packed = [(1, b"abcd", ENCODING_PACKED, 5), (2, b"efgh", ENCODING_PACKED, 6), (1, b"", ENCODING_PACKED, 7)]
    others = [(3, b"{}", ENCODING_JSON + ";v1", 8), (1, b"?", "text/plain", 9), (2, b"ijkl", ENCODING_PACKED, 10)]
    turns = [BoxTurn(100, packed), BoxTurn(200, others)]
    block = Block(b"".join(encoded_turns(turns, {1: ("a", "x"), 2: ("a", "y"), 3: ("b", "x")})))
    found = [(turn.t_ns, message) for turn in block.turns("a") for message in turn.messages]
    assert found == [
        (100, ("x", b"abcd", ENCODING_PACKED, 5)),
        (100, ("y", b"efgh", ENCODING_PACKED, 6)),
        (100, ("x", b"", ENCODING_PACKED, 7)),
        (200, ("y", b"ijkl", ENCODING_PACKED, 10)),
    ]
    assert [turn.messages for turn in block.turns("b", {"x"})] == [[("x", b"{}", ENCODING_JSON, 8)]]


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40])


def flip(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    whole[-40] ^= 0x80
    path.write_bytes(whole)


def add_noise(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40] + bytes(range(200)) * 3)


@pytest.mark.parametrize("damage", [cut, flip, add_noise])
def test_what_damage_leaves_of_a_piece_is_used_up_to_there(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    boxed = Boxed(tmp_path)
    for _ in range(3):
        boxed.send()
        boxed.write()
    (piece,) = pieces_in(tmp_path)
    damage(piece.path)
    assert len(sent_in(boxed)) == 2


@pytest.mark.parametrize("damage", [cut, flip, add_noise])
def test_no_run_goes_on_after_a_piece_that_is_damaged(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    boxed = Boxed(tmp_path)
    for _ in range(3):
        boxed.send(seconds=30)
        boxed.write()
    first, second = pieces_in(tmp_path)
    assert first.session == second.session
    damage(first.path)
    assert sent_in(boxed)[-1] < second.from_ns


def sent_in(boxed: Boxed) -> list[int]:
    """Return when the samples of the tag arrived that the box holds."""
    sent = Sent(boxed.box.folder, "default", TAG, T0_NS, boxed.clock.t_ns, False)
    return [int(line.split(",")[1]) for line in b"".join(sent.table()).decode().splitlines()[1:]]


@pytest.mark.parametrize("content", [b"", b"HEAD", b"[1]\n" * 100])
def test_a_piece_without_a_beginning_says_so(tmp_path: Path, content: bytes) -> None:
    boxed = Boxed(tmp_path)
    boxed.send()
    boxed.write()
    pieces_in(tmp_path)[0].path.write_bytes(content)
    with pytest.raises(BoxError):
        Rerun(tmp_path, "default", TAG, T0_NS + S, T0_NS + S)


def test_a_disk_that_takes_nothing_costs_its_minutes_alone_and_is_named_meanwhile(tmp_path: Path) -> None:
    boxed = Boxed(tmp_path)
    boxed.send(seconds=2)
    boxed.write()
    with full_disk():
        boxed.send(seconds=2)
        boxed.write()
        assert "black box cannot be written" in (boxed.box.problem or "")
        boxed.send()
        boxed.write()
    boxed.send(seconds=round(PATIENT_S) + 2)
    boxed.write()
    assert boxed.box.problem is None
    first, second = pieces_in(tmp_path)
    assert first.session != second.session  # no run passes over what is missing
    assert boxed.bench.rejected() == {}


def test_a_state_that_is_larger_than_the_queue_is_copied_once_a_piece(tmp_path: Path) -> None:
    boxed = Boxed(tmp_path, tags=2, queued=2000)
    boxed.send(seconds=5)
    boxed.write()
    assert boxed.box.writer.dropped == 0
    (piece,) = pieces_in(tmp_path)
    assert piece.size() > 2000
    assert len(sent_in(boxed)) == 5


def test_while_the_disk_hangs_one_state_waits_and_after_what_was_lost_a_new_session_begins(tmp_path: Path) -> None:
    boxed = Boxed(tmp_path, queued=2000)
    boxed.write()
    boxed.send(seconds=60)  # nothing is written meanwhile
    assert boxed.box.writer.dropped == 2  # one turn, and the first after a new beginning: nothing else is tried
    boxed.write()
    boxed.send(seconds=2)
    boxed.write()
    pieces = pieces_in(tmp_path)
    assert len({piece.session for piece in pieces}) == len(pieces) == 3  # no run passes over what was lost
    assert [*pieces[-1].records(TURNS)]


def test_the_oldest_pieces_go_when_the_box_is_full_or_they_are_old(tmp_path: Path) -> None:
    def kept_within(name: str, limits: Limits) -> list[Piece]:
        boxed = Boxed(tmp_path / name, limits=limits)
        for _ in range(12):
            boxed.send(seconds=30)
            boxed.write()
        return pieces_in(boxed.box.folder)

    every = kept_within("all", LIMITS)
    for limits in (Limits(sum(piece.size() for piece in every) // 2, 10**18), Limits(2**40, 100 * S)):
        kept, folder = kept_within(str(limits.max_bytes), limits), tmp_path / str(limits.max_bytes)
        assert 1 < len(kept) < len(every)
        assert kept[0].from_ns > T0_NS
        assert sum(piece.size() for piece in kept[:-1]) <= limits.max_bytes
        with pytest.raises(BoxError, match="it begins at"):
            Rerun(folder, "default", TAG, T0_NS + S, T0_NS + S)


def test_samples_in_json_can_be_asked_for_and_nothing_is_written_while_nobody_sends(tmp_path: Path) -> None:
    boxed = Boxed(tmp_path)
    boxed.bench.put(TAG, encode_json(Frame(ranges=[RangeSample(T0_NS, 1, 7.25)])), ENCODING_JSON, at_ns=T0_NS)
    boxed.turn(T0_NS + S)
    sizes = []
    for minute in range(1, 9):
        boxed.turn(T0_NS + minute * 60 * S)
        boxed.write()
        sizes.append([piece.size() for piece in pieces_in(tmp_path)])
    assert sizes[2:] == [sizes[1]] * 6
    assert sent_in(boxed) == [T0_NS]
