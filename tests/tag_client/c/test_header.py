"""dropanchor.h, compiled by the machine's compiler with every warning an error and under the sanitizers: the same bytes
as the Python codec, the same refusals, and no byte read where there is none."""

import json
import random
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas import keys
from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.wire import COUNTS_AT, Rejection, anchor_number, encode_packed, read_header
from support.golden import FILE, FRAMES, GOLDEN_KINDS
from support.patience import PATIENCE_S

ROOT = Path(__file__).parents[3]
HEADER = ROOT / "tag_client/c"
GOLDEN: dict[str, Any] = json.loads(FILE.read_text())
WARNINGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O1")


@pytest.fixture(scope="module")
def codec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("there is no C compiler: gcc or clang is needed to test dropanchor.h")
    program = tmp_path_factory.mktemp("c") / "codec"
    source = Path(__file__).parent / "codec.c"
    command = [compiler, *WARNINGS, *SANITIZERS, f"-I{HEADER}", str(source), "-o", str(program)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return program


def run(codec: Path, *arguments: str, data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    done = subprocess.run([codec, *arguments], input=data, capture_output=True, timeout=PATIENCE_S, check=False)
    assert b"Sanitizer" not in done.stderr, done.stderr.decode()
    assert b"runtime error" not in done.stderr, done.stderr.decode()
    return done


def as_text(frame: dict[str, Any]) -> str:
    """A frame as the test program reads it."""
    lines = [f"{int(frame['boot_clock'])} {int(frame['replay'])} {frame['sequence']} {frame['boot_id']}"]
    for kind in ("imu", "range", "heading", "bearing", "pressure"):
        for sample in frame[kind]:
            lines.append(" ".join([kind, *(word for value in sample.values() for word in words(value, kind))]))
    return "\n".join(lines) + "\n"


def words(value: Any, kind: str) -> list[str]:
    if value is None:
        return ["nan"] * (3 if kind == "imu" else 1)
    if isinstance(value, list):
        return [word for part in value for word in words(part, kind)]
    return [float.hex(value) if isinstance(value, float) else str(value)]


@pytest.mark.parametrize("name", GOLDEN["frames"])
def test_c_writes_the_bytes_that_python_writes(codec: Path, name: str) -> None:
    golden = GOLDEN["frames"][name]
    done = run(codec, "encode", data=as_text(golden["frame"]).encode())
    assert (done.returncode, done.stdout.hex()) == (0, golden["packed"])


@pytest.mark.parametrize("name", GOLDEN["frames"])
def test_what_c_reads_it_writes_again_as_the_same_bytes(codec: Path, name: str) -> None:
    """A time that is not a multiple of 1000 ns was rounded when it was written first, and stays as it is."""
    packed = bytes.fromhex(GOLDEN["frames"][name]["packed"])
    read = run(codec, "decode", data=packed)
    assert read.returncode == 0
    assert run(codec, "encode", data=read.stdout).stdout == packed


@pytest.mark.parametrize("name", GOLDEN["refused"])
def test_c_refuses_what_python_refuses_for_the_same_reason(codec: Path, name: str) -> None:
    refused = GOLDEN["refused"][name]
    packed = bytes.fromhex(refused["packed"])
    done = run(codec, "check", data=struct.pack("<I", len(packed)) + packed)
    assert done.stdout.decode() == f"{refused['reason']}\n"


def test_thousands_of_mutated_payloads_are_judged_alike_and_read_within_their_bytes(codec: Path) -> None:
    rng = random.Random(7)
    whole = [encode_packed(frame) for frame in FRAMES.values()]
    payloads = [b"", bytes(70_000), *(mutated(rng, rng.choice(whole)) for _ in range(5000))]
    payloads = [data for data in payloads if not has_later_kind(data)]
    done = run(codec, "check", data=b"".join(struct.pack("<I", len(data)) + data for data in payloads))
    found = done.stdout.decode().split()
    assert found == [reason(data) for data in payloads]
    assert len(set(found)) >= 8


def mutated(rng: random.Random, data: bytes) -> bytes:
    broken = bytearray(data)
    for _ in range(rng.choice([0, 1, 1, 2])):
        broken[rng.randrange(min(len(broken), 40))] = rng.choice([0, 1, 2, 0x3F, 0x40, 0x80, 0xFF])
    return bytes(broken[: rng.choice([len(broken), len(broken), rng.randrange(len(broken))])])


def has_later_kind(data: bytes) -> bool:
    """Return whether the header counts samples of a kind that the C codec need not know."""
    return any(any(data[at : at + 2]) for kind, at in zip(KINDS, COUNTS_AT, strict=False) if kind not in GOLDEN_KINDS)


def reason(data: bytes) -> str:
    header = read_header(data)
    return header.reason.value if isinstance(header, Rejection) else "ok"


def test_what_cannot_be_sent_is_not_written(codec: Path) -> None:
    for frame in [
        "0 0 1 1\n",
        "0 0 1 1\nrange -1 7 0x1p+1 nan\n",
        f"0 0 1 1\nrange {2**62} 7 0x1p+1 nan\n",
        "0 0 1 1\nheading 0 0x1p+1 nan\nheading 4294967295500 0x1p+1 nan\n",
    ]:
        assert run(codec, "encode", data=frame.encode()).returncode == 4, frame


@pytest.mark.parametrize(
    "anchor",
    ["7", "007", "L0", "4294967295", "4294967296", "0", "00", "é", "18446744073709551623", "1e3", "-1", "9" * 60],
)
def test_anchors_have_the_numbers_that_python_gives_them(codec: Path, anchor: str) -> None:
    assert run(codec, "number", anchor).stdout.decode() == f"{anchor_number(anchor)}\n"


@pytest.mark.parametrize("tag", ["cart-1", "tag 1", "Gabelstapler Süd", "a/b*c?d#e$f%g~", "é" * 64, "A.b_c-9"])
def test_keys_are_escaped_as_python_escapes_them(codec: Path, tag: str) -> None:
    assert run(codec, "key", "default", tag).stdout.decode() == f"{keys.samples_key('default', tag)}\n"


@pytest.mark.parametrize("tag", ["", "é" * 65, "a\tb", "a\x7fb", ".", ".."])
def test_an_id_that_is_not_allowed_has_no_key(codec: Path, tag: str) -> None:
    with pytest.raises(keys.InvalidKeyError):
        keys.samples_key("default", tag)
    assert run(codec, "key", "default", tag).returncode == 4
