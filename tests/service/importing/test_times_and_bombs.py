"""Every reader holds the rules of times, and unpacks no more than a limit, however small the file is."""

import gzip
import json
import resource
import struct
import zipfile
from array import array
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import zstandard
from lz4.frame import LZ4FrameCompressor
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, RangeSample, anchor_number, encode_packed
from dropanchor_service.cli import main
from dropanchor_service.recording.mcap_file import PROFILE
from dropanchor_tag_client.recording import Anchor, Recording
from service.importing import formats
from service.importing.command import Import
from service.importing.test_bags import recorded

ROWS, CHANGED = 400, 200
SET_BACK = [i / 100 if i < CHANGED else i / 100 - 10 for i in range(ROWS)]
ABSURD = [1e18 if i == CHANGED else i / 100 for i in range(ROWS)]
LATEST_OF_ROS_S = 2**31 - 1 - formats.T0_NS // 10**9

Write = Callable[[Path, Sequence[float]], Path]
"""Writes samples with these times in s, and returns the source."""


def table(folder: Path, times: Sequence[float]) -> Path:
    (folder / "uwb.csv").write_text("t_s,anchor,range_m\n" + "".join(f"{t!r},A,{5 + t % 1:.3f}\n" for t in times))
    return folder / "uwb.csv"


def json_lines(folder: Path, times: Sequence[float]) -> Path:
    rows = ({"t": round(t * 1e9), "imu": {"acc": [0, 0, 9.8], "gyro": [0, 0, 0]}} for t in times)
    (folder / "imu.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return folder / "imu.jsonl"


def drive(times: Sequence[float]) -> Recording:
    imu = {
        name: array("d", [9.8 if name == "az" else 0.1] * len(times)) for vector in formats.VECTORS for name in vector
    }
    return Recording("a", (Anchor("1", 0, 0, 0),), (), {}, {"t_s": array("d", times)} | imu)


def sensor_logger(folder: Path, times: Sequence[float]) -> Path:
    return formats.sensor_logger(folder / "phone.zip", drive(times), platform="android")


def phyphox(folder: Path, times: Sequence[float]) -> Path:
    return formats.phyphox(folder / "phone", drive(times))


def ranges(times: Sequence[float], ros: formats.Messages) -> list[formats.Stamped]:
    stamps = formats.utc_ns(min(t, LATEST_OF_ROS_S) for t in times)
    return [(formats.T0_NS + i, "/uwb", ros.range(t_ns, 5.0)) for i, t_ns in enumerate(stamps)]


def ros1(folder: Path, times: Sequence[float]) -> Path:
    ros = formats.Messages(Stores.ROS1_NOETIC)
    return formats.ros1_bag(folder / "a.bag", ranges(times, ros), ros)


def ros2(storage: StoragePlugin) -> Write:
    def write(folder: Path, times: Sequence[float]) -> Path:
        ros = formats.Messages(Stores.ROS2_JAZZY)
        return formats.ros2_bag(folder / "a", ranges(times, ros), ros, storage)

    return write


def json_mcap(folder: Path, times: Sequence[float]) -> Path:
    stamps = (divmod(round(t * 1e9), 10**9) for t in times)
    messages = ({"timestamp": {"sec": sec, "nsec": nsec}, "anchor": "A", "distance": 5.0} for sec, nsec in stamps)
    return formats.json_mcap(folder / "a.mcap", [(i, "/uwb", message) for i, message in enumerate(messages)])


def own(folder: Path, times: Sequence[float]) -> Path:
    """Return a recording of this service. Its messages have no absurd times: the wire format has none."""
    gate = anchor_number("gate")
    frames = (
        Frame(ranges=[RangeSample(t_ns, gate, 5.0, 0.1)], sequence=i, boot_id=9)
        for i, t_ns in enumerate(formats.utc_ns(min(t, 1e9) for t in times))
    )
    return recorded(folder / "r", [(0, encode_packed(frame), ENCODING_PACKED) for frame in frames])


def folder_of(name: str) -> Write:
    """Return what writes the folder of a recording, as CSV or as JSON lines."""

    def write(folder: Path, times: Sequence[float]) -> Path:
        (folder / "anchors.csv").write_text("id,x,y,z\nA,0,0,0\n")
        rows = [{"t_s": t, "anchor_id": "A", "range_m": 5 + t % 1} for t in times]
        text = "".join(json.dumps(row) + "\n" for row in rows)
        if name.endswith(".csv"):
            text = "t_s,anchor_id,range_m\n" + "".join(",".join(map(str, row.values())) + "\n" for row in rows)
        (folder / name).write_text(text)
        return folder

    return write


READERS: dict[str, tuple[str, Write, str]] = {
    "table": ("import", table, f"uwb.csv line {CHANGED + 2}"),
    "json lines": ("import", json_lines, f"imu.jsonl line {CHANGED + 1}"),
    "sensor logger": ("import", sensor_logger, f"Gyroscope.csv line {CHANGED + 2}"),
    "phyphox": ("import", phyphox, f".csv line {CHANGED + 2}"),
    "ros 1": ("import", ros1, f"/uwb message {CHANGED + 1}"),
    "ros 2, db3": ("import", ros2(StoragePlugin.SQLITE3), f"/uwb message {CHANGED + 1}"),
    "ros 2, mcap": ("import", ros2(StoragePlugin.MCAP), f"/uwb message {CHANGED + 1}"),
    "mcap": ("import", json_mcap, f"/uwb message {CHANGED + 1}"),
    "own mcap": ("import", own, f".mcap message {CHANGED + 1}"),
    "folder": ("replay", folder_of("range.csv"), f"range.csv line {CHANGED + 2}"),
    "folder of json": ("replay", folder_of("range.jsonl"), f"range.jsonl line {CHANGED + 1}"),
}
each_reader = pytest.mark.parametrize("reader", READERS)


def call(command: str, source: Path, folder: Path) -> int:
    options = ["--out", str(folder / "out"), "--without-imu"] if command == "import" else []
    return main([command, str(source), *options])


@each_reader
def test_a_clock_that_is_set_back_is_refused_with_its_place_the_step_and_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], reader: str
) -> None:
    command, write, place = READERS[reader]
    assert call(command, write(tmp_path, SET_BACK), tmp_path) == 2
    error = capsys.readouterr().err
    assert f"{place}: the time goes back by 10.0 s" in error
    assert "split it there" in error
    assert not (tmp_path / "out").exists()


@each_reader
def test_an_absurd_time_is_left_out_with_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], reader: str
) -> None:
    command, write, place = READERS[reader]
    assert call(command, write(tmp_path, ABSURD), tmp_path) == 0
    assert f"{place}: a time more than 30 days from most others: left out" in capsys.readouterr().out


@each_reader
def test_times_that_are_all_absurd_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], reader: str) -> None:
    command, write, _ = READERS[reader]
    if reader.startswith(("ros", "own")):
        pytest.skip("the format has no such times")
    assert call(command, write(tmp_path, [1e19 + 1e12 * i for i in range(ROWS)]), tmp_path) == 2
    assert "after 2116" in capsys.readouterr().err


@pytest.mark.parametrize("unit", [1e9, 1e6])
def test_a_column_of_seconds_that_cannot_be_is_read_in_the_unit_that_it_has(run: Import, unit: float) -> None:
    rows = "".join(f"{(1_760_000_000 + i / 100) * unit:.0f},A,5\n" for i in range(ROWS))
    ended = run(run.file("uwb.csv", "t_s,anchor,range_m\n" + rows))
    assert ended.status == 0, ended.error
    assert ended.column("range", "t_s")[:2] == pytest.approx([0.0, 0.01], abs=1e-5)
    assert "t_s: the values are after 2116 in s" in ended.printed


def test_two_sources_with_ranges_to_one_anchor_at_the_same_time_are_refused(run: Import) -> None:
    one, other = (run.file(name, "t_s,range\n0,5\n1,6\n") for name in ("a.csv", "b.csv"))
    ended = run(one, other)
    assert ended.status == 2
    assert "b.csv and another source have ranges to 1 at the same time" in ended.error
    assert run(one, run.file("b.csv", "t_s,range\n2,5\n3,6\n"), out="apart").rows("range")[3]["t_s"] == "3.000000000"


def test_what_a_tag_sent_late_stands_where_it_belongs(run: Import) -> None:
    """A tag that was cut off sends first what is new, then what it kept."""
    frames = [
        Frame(
            ranges=[RangeSample(formats.T0_NS + i * 10**9, anchor_number("gate"), 5.0 + i, 0.1)], sequence=i, boot_id=9
        )
        for i in (0, 1, 8, 9, 2, 3, 4, 5, 6, 7)
    ]
    path = recorded(run.folder / "r", [(0, encode_packed(frame), ENCODING_PACKED) for frame in frames])
    ended = run(path)
    assert ended.status == 0, ended.error
    assert ended.column("range", "range_m") == [5.0 + i for i in range(10)]


MIB = 2**20
BLOCK = bytes(MIB)
COMMENTS = (b"#" * 999 + b"\n") * 20_000


def zstd(mib: int, is_told: bool = True) -> bytes:
    packer = zstandard.ZstdCompressor(level=1).compressobj(size=mib * MIB if is_told else -1)
    return b"".join(packer.compress(BLOCK) for _ in range(mib)) + packer.flush()


def lz4(mib: int) -> bytes:
    packer = LZ4FrameCompressor()
    packed: bytes = packer.begin() + b"".join(packer.compress(BLOCK) for _ in range(mib)) + packer.flush()
    return packed


def mcap(profile: str, compression: str, packed: bytes, told: int) -> bytes:
    """Return an MCAP file with one chunk. told: how many bytes it says that the chunk unpacks to."""

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    def record(opcode: int, content: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(content)) + content

    chunk = struct.pack("<QQQI", 0, 1, told, 0) + text(compression) + struct.pack("<Q", len(packed)) + packed
    return b"\x89MCAP0\r\n" + record(1, text(profile) + text("x")) + record(6, chunk)


def ros2_folder(folder: Path, mode: CompressionMode) -> Path:
    ros = formats.Messages(Stores.ROS2_HUMBLE)
    bag = Writer2(folder / "a", version=8, storage_plugin=StoragePlugin.SQLITE3)
    bag.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        connection = bag.add_connection("/uwb", "sensor_msgs/msg/Range", typestore=ros.store)
        bag.write(connection, formats.T0_NS, bytes(130 * MIB))
    return folder / "a"


def ros1_chunk(folder: Path, form: Writer1.CompressionFormat) -> Path:
    ros = formats.Messages(Stores.ROS1_NOETIC)
    bag = Writer1(folder / "a.bag")
    bag.set_compression(form)
    with bag:
        connection = bag.add_connection("/uwb", "sensor_msgs/msg/Range", typestore=ros.store)
        bag.write(connection, formats.T0_NS, bytes(130 * MIB))
    return folder / "a.bag"


def mcap_in_folder(folder: Path) -> Path:
    ros = formats.Messages(Stores.ROS2_JAZZY)
    bag = formats.ros2_bag(folder / "a", ranges([0.0], ros), ros, StoragePlugin.MCAP)
    next(bag.glob("*.mcap")).write_bytes(mcap("ros2", "zstd", zstd(512), 512 * MIB))
    return bag


def written(name: str, content: Callable[[], bytes]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content())
        return folder / name

    return write


def zipped(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("uwb.csv", b"0" * 100 * MIB)
    return folder / "a.zip"


def packed_folder(folder: Path) -> Path:
    folder_of("range.csv")(folder, [0.0])
    (folder / "range.csv").unlink()
    (folder / "range.csv.gz").write_bytes(gzip.compress(b"t_s,anchor_id,range_m\n" + COMMENTS))
    return folder


def parquet(folder: Path) -> Path:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    folder_of("range.csv")(folder, [0.0])
    (folder / "range.csv").unlink()
    rows = 2**22
    columns = {"t_s": pa.array([0.0]), "anchor_id": pa.array(["A"]), "range_m": pa.array([5.0])}
    with pq.ParquetWriter(folder / "range.parquet", pa.schema([(n, c.type) for n, c in columns.items()])) as writer:
        writer.write_table(pa.table({name: pa.repeat(column[0], rows) for name, column in columns.items()}))
    return folder


BOMBS: dict[str, tuple[str, Callable[[Path], Path]]] = {
    "mcap, zstd": ("import", written("a.mcap", lambda: mcap("", "zstd", zstd(512), 512 * MIB))),
    "mcap, zstd that lies": ("import", written("a.mcap", lambda: mcap("", "zstd", zstd(512, False), 100 * MIB))),
    "mcap, lz4": ("import", written("a.mcap", lambda: mcap("", "lz4", lz4(512), 512 * MIB))),
    "mcap, lz4 that lies": ("import", written("a.mcap", lambda: mcap("", "lz4", lz4(512), 100 * MIB))),
    "own mcap": ("import", written("a.mcap", lambda: mcap(PROFILE, "zstd", zstd(512), 512 * MIB))),
    "own mcap, replayed": ("replay", written("a.mcap", lambda: mcap(PROFILE, "zstd", zstd(512), 512 * MIB))),
    "ros 2, mcap": ("import", mcap_in_folder),
    "ros 2, packed messages": ("import", lambda folder: ros2_folder(folder, CompressionMode.MESSAGE)),
    "ros 2, packed file": ("import", lambda folder: ros2_folder(folder, CompressionMode.FILE)),
    "ros 1, bz2": ("import", lambda folder: ros1_chunk(folder, Writer1.CompressionFormat.BZ2)),
    "ros 1, lz4": ("import", lambda folder: ros1_chunk(folder, Writer1.CompressionFormat.LZ4)),
    "table, gz": ("import", written("a.csv.gz", lambda: gzip.compress(b"t,range\n0,5\n1,6\n" + COMMENTS))),
    "json, gz": ("import", written("a.jsonl.gz", lambda: gzip.compress(b"[" * 20 * MIB))),
    "zip": ("import", zipped),
    "folder, gz": ("replay", packed_folder),
    "folder, parquet": ("replay", parquet),
    "parquet": ("import", lambda folder: parquet(folder) / "range.parquet"),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_bomb_is_refused_with_its_limit_before_it_fills_the_memory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bomb: str
) -> None:
    command, write = BOMBS[bomb]
    source = write(tmp_path)
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert call(command, source, tmp_path) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1, error
    assert "unpacks to" in error or "does not hold the" in error or "is longer than" in error
    assert source.name in error
    assert "MiB" in error or "characters" in error or "bytes" in error
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 300 * 1024
