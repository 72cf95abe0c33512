"""Recordings are files that viewers open and replays repeat, and that survive kills and full disks."""

import json
import os
import resource
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from dropanchor_schemas.site import Anchor, Georeference, Site, TagSettings
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED
from dropanchor_service.estimation.columns import POSE, Frame, HeightSource, State
from dropanchor_service.recording import mcap_file
from dropanchor_service.recording.folder import Limits, files_in, prune
from dropanchor_service.recording.reading import RecordingReader, Turn
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.recording.schemas import all_schemas
from dropanchor_service.store import SiteStore, TagTable
from dropanchor_tag_client.folder_lock import FolderInUseError
from dropanchor_tag_client.recording import RecordingError

S = 1_000_000_000
T_NS = 1_800_000_000 * S
UNLIMITED = Limits(2**30, 3600 * S, 1000, 10**18, 2**40)
SITE = Site(anchors=[Anchor(id="7", x=1.0, z=2.5)], georeference=Georeference(lat=52.5, lon=13.4, alt_m=34.5))


class RecorderBench:
    """A recorder without its thread: `write` does the thread's work."""

    def __init__(self, folder: Path, limits: Limits = UNLIMITED) -> None:
        self.now_ns = T_NS
        self.tags = TagTable()
        self.site = SiteStore(SITE, {"a": TagSettings(height_m=1.5)})
        self.recorder = Recorder(folder, limits, S // 5, self.tags, self.site, lambda: self.now_ns, {"engine": "paper"})
        for name in ("a", "b/ü"):
            self.tags.register(name)

    def receive(self, count: int = 1, row: int = 0, size: int = 40) -> None:
        for _ in range(count):
            self.now_ns += S // 10
            payload = b"%d" % self.now_ns + b"x" * size
            self.recorder.record_messages([(row, payload, ENCODING_PACKED, self.now_ns - 7)])

    def estimate(self, **fields: Any) -> None:
        pose = np.zeros(1, POSE)
        pose["t_ns"], pose["state"] = self.now_ns, State.TRACKING
        pose["cov"], pose["z"] = np.diag([0.04, 0.01, 0.001]), np.nan
        for name, value in fields.items():
            pose[name] = value
        self.recorder.record_poses(pose)

    def write(self) -> bool:
        return self.recorder.writer.flush()

    def paths(self) -> list[Path]:
        return [self.recorder.folder / file.name for file in self.recorder.files()]

    def turns(self) -> list[Turn]:
        return [turn for path in self.paths() for turn in RecordingReader(path).turns()]

    def payloads(self) -> list[bytes]:
        return [message[1] for turn in self.turns() for message in turn.messages]


def test_messages_are_read_back_with_their_turn_their_arrival_and_the_site(tmp_path: Path) -> None:
    bench = RecorderBench(tmp_path)
    assert bench.recorder.start()
    assert not bench.recorder.start()
    bench.now_ns += 1
    bench.recorder.record_messages(
        [(1, b"packed", ENCODING_PACKED, T_NS), (0, b"{}", ENCODING_JSON + ";v1", T_NS - 5), (0, b"?", "text/plain", 1)]
    )
    bench.site.set_anchor(Anchor(id="8"))
    bench.receive()
    assert bench.recorder.stop()
    assert bench.write()
    first, second = bench.turns()
    assert first.site == bench.site.document.model_copy(update={"site": SITE})
    assert first.messages == [("b/ü", b"packed", ENCODING_PACKED, T_NS), ("a", b"{}", ENCODING_JSON, T_NS - 5)]
    assert second.site == bench.site.document
    assert (first.t_ns, second.t_ns) == (T_NS + 1, bench.now_ns)


def test_only_chosen_tags_are_recorded_and_only_while_a_recording_runs(tmp_path: Path) -> None:
    bench = RecorderBench(tmp_path)
    bench.receive()
    bench.recorder.start(["b/ü", "nobody"])
    bench.receive(row=0)
    bench.receive(row=1)
    bench.estimate(row=0)
    bench.recorder.stop()
    bench.receive(row=1)
    bench.write()
    assert [message[0] for turn in bench.turns() for message in turn.messages] == ["b/ü"]
    assert not any(turn.estimates for turn in bench.turns())


@pytest.mark.parametrize(("z", "shown"), [(np.nan, 1.5), (6.25, 6.25)], ids=["as told", "estimated"])
def test_poses_are_recorded_in_schemas_that_viewers_know_and_are_valid(tmp_path: Path, z: float, shown: float) -> None:
    bench = RecorderBench(tmp_path)
    bench.recorder.start()
    bench.receive()
    bench.estimate(x=3.0, y=4.0, z=z, z_std=0.5, z_source=HeightSource.PRESSURE, heading=np.pi / 2, anchor=0, range=5.0)
    bench.now_ns += S
    bench.estimate(x=np.nan, y=np.nan, cov=np.nan, state=State.AMBIGUOUS, anchor=-1)
    bench.recorder.stop()
    bench.write()
    found: dict[str, list[Any]] = {}
    with bench.paths()[0].open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "dropanchor"
        for schema, channel, message in reader.iter_messages():
            if schema is not None:
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                Draft202012Validator(json.loads(schema.data)).validate(json.loads(message.data))
                found.setdefault(schema.name, []).append(json.loads(message.data))
    pose = found["foxglove.PoseInFrame"]
    assert pose[0]["pose"]["position"] == {"x": 3.0, "y": 4.0, "z": shown}
    assert pose[0]["pose"]["orientation"]["z"] == pytest.approx(0.5**0.5)
    assert (len(pose), len(found["foxglove.LocationFix"]), len(found["dropanchor.Estimate"])) == (1, 1, 2)
    fix = found["foxglove.LocationFix"][0]
    estimated = np.isfinite(z)
    assert (fix["altitude"], fix["position_covariance"][8]) == ((40.75, 0.25) if estimated else (0.0, 1e6))
    assert fix["position_covariance"][:8] == [0.04, 0, 0, 0, 0.01, 0, 0, 0]
    assert fix["position_covariance_type"] == 1
    assert found["foxglove.FrameTransform"][0]["translation"] == {"x": 1.0, "y": 0.0, "z": 2.5}
    assert found["dropanchor.Estimate"][0]["anchor"] == "7"
    assert "x" not in found["dropanchor.Estimate"][1]
    heights = [found["dropanchor.Estimate"][0].get(name) for name in ("z", "z_std_m", "z_source")]
    assert heights == ([6.25, 0.5, "pressure"] if estimated else [None, 0.5, None])
    assert len(found["dropanchor.PackedSamples"]) == 1


def test_a_place_in_a_frame_of_the_tags_own_has_a_topic_of_its_own_and_no_location(tmp_path: Path) -> None:
    bench = RecorderBench(tmp_path)
    bench.recorder.start()
    bench.receive()
    bench.estimate(x=3.0, y=4.0, frame=Frame.RELATIVE)
    bench.now_ns += S
    bench.estimate(x=-4.0, y=3.0)
    bench.recorder.stop()
    bench.write()
    with bench.paths()[0].open("rb") as file:
        found = [
            (channel.topic, json.loads(message.data))
            for schema, channel, message in make_reader(file).iter_messages()
            if schema is not None and channel.topic.startswith("/tag/a/")
        ]
    frames = [(topic, message["frame_id"]) for topic, message in found if "frame_id" in message]
    assert frames == [("/tag/a/relative_pose", "site/a"), ("/tag/a/pose", "site"), ("/tag/a/location", "site")]
    own, placed = [message for topic, message in found if topic == "/tag/a/estimate"]
    assert (own["state"], own["relative_pose"]["x"], "x" in own, "covariance" in own) == ("relative", 3.0, False, False)
    assert (placed["state"], placed["x"], "relative_pose" in placed) == ("tracking", -4.0, False)


def is_supported(schema: Any) -> bool:
    """Return whether Foxglove and Lichtblick support the schema. They refuse topics with any other."""
    if schema["type"] == "object":
        return all(map(is_supported, schema["properties"].values()))
    if schema["type"] == "array":
        return schema["items"]["type"] != "array" and is_supported(schema["items"])
    return schema["type"] in ("boolean", "string", "number", "integer")


def test_viewers_support_every_schema() -> None:
    assert all(map(is_supported, all_schemas().values()))


def test_a_file_that_is_cut_off_anywhere_is_read_up_to_the_cut(tmp_path: Path) -> None:
    bench = RecorderBench(tmp_path)
    bench.recorder.start()
    ends = []
    for _ in range(4):
        bench.receive(5)
        bench.write()
        ends.append(bench.paths()[0].stat().st_size)
    everything = bench.payloads()
    assert len(everything) == 20
    whole = bench.paths()[0].read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole)
    for length in reversed(range(len(whole))):
        os.truncate(torn, length)  # a new content would wait for the disk, thousands of times
        reader = RecordingReader(torn)
        try:
            read = [message[1] for turn in reader.turns() for message in turn.messages]
        except RecordingError:
            assert length < 100  # the header is incomplete
            continue
        at_least = 5 * sum(end <= length for end in ends)
        assert read == everything[: len(read)]
        assert len(read) >= at_least
        assert reader.read_error is not None


def test_a_file_without_room_for_more_tags_leaves_their_messages_out_and_says_so_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(mcap_file, "MAX_CHANNELS", 8)
    bench = RecorderBench(tmp_path)
    names = [bench.tags.register(f"tag-{number}").name for number in range(20)]
    bench.recorder.start()
    for row in range(2, 2 + len(names)):
        bench.receive(row=row)
    bench.write()
    bench.recorder.stop()
    bench.write()
    recorded = {message[0] for turn in bench.turns() for message in turn.messages}
    assert 0 < len(recorded) < 8
    assert recorded < set(names)
    assert [record.getMessage() for record in caplog.records if "no room for more tags" in record.getMessage()] == [
        f"{bench.paths()[0].name} has no room for more tags; they are recorded again in the next file"
    ]


def test_a_full_file_is_followed_by_another_and_each_can_be_replayed_alone(tmp_path: Path) -> None:
    bench = RecorderBench(tmp_path, Limits(2000, 3600 * S, 1000, 10**18, 2**40))
    bench.recorder.start()
    for _ in range(6):
        bench.receive(40, size=200)
        bench.write()
    bench.recorder.stop()
    bench.write()
    assert len(bench.paths()) >= 3
    assert all(file.finished for file in bench.recorder.files())
    assert len(bench.payloads()) == 240
    for path in bench.paths():
        assert next(RecordingReader(path).turns()).site == bench.site.document


@pytest.mark.parametrize(
    ("limits", "left"),
    [(Limits(1, 1, 2, 10**18, 2**40), "de"), (Limits(1, 1, 99, 10**18, 2500), "de"), (Limits(1, 1, 99, 0, 2**40), "")],
)
def test_the_oldest_files_are_deleted_by_count_size_and_age_but_never_the_open_one(
    tmp_path: Path, limits: Limits, left: str
) -> None:
    for name in "abcde":
        (tmp_path / f"{name}.mcap").write_bytes(b"x" * 1000)
    prune(tmp_path, limits, "a.mcap" if left else None)
    kept = "".join(file.name[0] for file in files_in(tmp_path))
    assert kept in {left, "a" + left, "a" + left[1:]}
    assert not left or "a" in kept


@pytest.fixture
def file_size_limit() -> Iterator[Any]:
    """A function that limits the size of the files of this process, in bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_loses_no_queued_message_and_leaves_a_valid_file(tmp_path: Path, file_size_limit: Any) -> None:
    bench = RecorderBench(tmp_path)
    bench.recorder.start()
    bench.receive(10)
    assert bench.write()
    size = bench.paths()[0].stat().st_size
    file_size_limit(size + 100)
    for _ in range(3):
        bench.receive(10, size=500)
        assert not bench.write()
    assert "recording cannot be written" in (bench.recorder.writer.problem or "")
    assert bench.paths()[0].stat().st_size == size
    file_size_limit(resource.RLIM_INFINITY)
    bench.recorder.stop()
    assert bench.write()
    assert bench.recorder.writer.problem is None
    assert len(bench.payloads()) == len(set(bench.payloads())) == 40
    assert bench.recorder.files()[0].finished


@pytest.mark.parametrize("nth", range(1, 6))
def test_a_write_that_fails_halfway_is_undone_and_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nth: int
) -> None:
    bench, calls, write = RecorderBench(tmp_path), count(1), os.write

    def failing(fd: int, data: Any) -> int:
        if next(calls) != nth:
            return write(fd, data)
        write(fd, data[: len(data) // 2])
        raise OSError(5, "Input/output error")

    bench.recorder.prepare()
    bench.recorder.start()
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", failing)
        outcomes = []
        for _ in range(6):
            bench.receive(5)
            outcomes.append(bench.write())
    assert outcomes.count(False) == 1
    bench.recorder.stop()
    assert bench.write()
    (path,) = bench.paths()
    reader = RecordingReader(path)
    payloads = [message[1] for turn in reader.turns() for message in turn.messages]
    assert len(payloads) == len(set(payloads)) == 30
    assert reader.read_error is None


def test_a_file_that_is_not_a_recording_is_refused(tmp_path: Path) -> None:
    for content in (b"", b"RIFF", b"\x89MCAP0\r\n" + b"\0" * 100):
        (tmp_path / "x.mcap").write_bytes(content)
        with pytest.raises(RecordingError, match="not a recording"):
            list(RecordingReader(tmp_path / "x.mcap").turns())


def test_a_second_recorder_with_the_folder_waits_and_says_who_has_it(tmp_path: Path) -> None:
    first, second = RecorderBench(tmp_path), RecorderBench(tmp_path)
    first.recorder.prepare()
    with pytest.raises(FolderInUseError, match=rf"recordings is in use by process {os.getpid()} on "):
        second.recorder.prepare()
    with first.recorder:
        pass
    second.recorder.prepare()
