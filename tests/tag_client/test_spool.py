"""The spool keeps messages on disk in their order, whatever a crash or a power cut leaves of its files."""

import os
import shutil
from pathlib import Path

import pytest

from dropanchor_tag_client.spool import MIN_LIMIT_BYTES, SEGMENT_BYTES, Spool, SpoolError
from support.commands import python

LIMIT = 10_000_000


def messages(count: int, begin: int = 0) -> list[bytes]:
    return [b"message %d" % i for i in range(begin, begin + count)]


def filled(folder: Path, wanted: list[bytes]) -> None:
    spool = Spool(folder, LIMIT)
    for message in wanted:
        spool.append(message)
    spool.close()


def drained(spool: Spool, at_once: int = 7) -> list[bytes]:
    """Remove and return all messages."""
    found: list[bytes] = []
    while chunk := spool.peek(at_once, LIMIT):
        found += chunk
        spool.remove(len(chunk))
    return found


def segment(folder: Path) -> Path:
    (only,) = folder.glob("*.spool")
    return only


def test_messages_come_back_in_order_and_leave_no_segment(tmp_path: Path) -> None:
    spool = Spool(tmp_path, LIMIT)
    for message in messages(100):
        spool.append(message)
    assert drained(spool) == messages(100)
    assert spool.is_empty
    assert spool.used_bytes == 0
    assert not list(tmp_path.glob("*.spool"))


def test_messages_that_are_appended_while_others_are_sent_come_behind_them(tmp_path: Path) -> None:
    spool, found = Spool(tmp_path, LIMIT), []
    for message in messages(100):
        spool.append(message)
        spool.append(message + b"!")
        found += spool.peek(1, LIMIT)
        spool.remove(1)
    found += drained(spool)
    assert found == [text for message in messages(100) for text in (message, message + b"!")]


def test_the_next_process_finds_what_was_not_removed(tmp_path: Path) -> None:
    filled(tmp_path, messages(100))
    spool = Spool(tmp_path, LIMIT)
    spool.peek(30, LIMIT)
    spool.remove(30)
    spool.append(b"new")
    spool.close()
    assert drained(Spool(tmp_path, LIMIT)) == [*messages(70, 30), b"new"]


def test_a_chunk_is_limited_in_bytes_but_has_a_message(tmp_path: Path) -> None:
    filled(tmp_path, [b"x" * 1000] * 5)
    spool = Spool(tmp_path, LIMIT)
    assert len(spool.peek(100, 2500)) == 2
    assert len(spool.peek(100, 1)) == 1


def test_a_record_that_is_cut_at_any_byte_is_skipped_and_counted(tmp_path: Path) -> None:
    filled(tmp_path / "whole", messages(5))
    whole = segment(tmp_path / "whole").read_bytes()
    record = len(whole) // 5
    for size in range(len(whole)):
        folder = tmp_path / str(size)
        shutil.copytree(tmp_path / "whole", folder)
        segment(folder).write_bytes(whole[:size])
        spool = Spool(folder, LIMIT)
        spool.append(b"after the crash")
        assert drained(spool) == [*messages(size // record), b"after the crash"]
        assert spool.damaged == (1 if size % record else 0)
        spool.close()


def test_a_record_that_is_damaged_at_any_byte_costs_no_other_message(tmp_path: Path) -> None:
    filled(tmp_path / "whole", messages(5))
    whole = segment(tmp_path / "whole").read_bytes()
    record = len(whole) // 5
    for at in range(len(whole)):
        folder = tmp_path / str(at)
        shutil.copytree(tmp_path / "whole", folder)
        segment(folder).write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        spool = Spool(folder, LIMIT)
        assert drained(spool) == [message for i, message in enumerate(messages(5)) if i != at // record]
        assert spool.damaged == 1
        spool.close()


def test_zeros_that_a_power_cut_leaves_are_skipped(tmp_path: Path) -> None:
    filled(tmp_path, messages(5))
    with segment(tmp_path).open("ab") as file:
        file.write(bytes(4096))
    spool = Spool(tmp_path, LIMIT)
    assert drained(spool) == messages(5)
    assert spool.damaged == 1


@pytest.mark.parametrize("slot", [0, 1])
def test_a_position_that_is_damaged_repeats_one_chunk_at_most(tmp_path: Path, slot: int) -> None:
    filled(tmp_path, messages(100))
    spool = Spool(tmp_path, LIMIT)
    for _ in range(4):
        spool.peek(10, LIMIT)
        spool.remove(10)
    spool.close()
    data = bytearray((tmp_path / "position").read_bytes())
    data[slot * len(data) // 2] ^= 0xFF
    (tmp_path / "position").write_bytes(data)
    assert drained(Spool(tmp_path, LIMIT))[0] in messages(11, 30)


def test_a_full_spool_drops_its_oldest_messages_and_counts_them(tmp_path: Path) -> None:
    spool = Spool(tmp_path, MIN_LIMIT_BYTES)
    wanted = [b"%06d" % i + bytes(1000) for i in range(3000)]
    for message in wanted:
        spool.append(message)
        assert spool.used_bytes <= MIN_LIMIT_BYTES
    assert sum(path.stat().st_size for path in tmp_path.glob("*.spool")) == spool.used_bytes
    kept = len(wanted) - spool.dropped
    assert kept * 1000 > MIN_LIMIT_BYTES - 2 * SEGMENT_BYTES
    assert drained(spool) == wanted[-kept:]


def test_two_programs_do_not_share_a_spool(tmp_path: Path) -> None:
    first = Spool(tmp_path, LIMIT)
    with pytest.raises(SpoolError, match="give each program a folder of its own"):
        Spool(tmp_path, LIMIT)
    first.close()
    Spool(tmp_path, LIMIT).close()


def test_a_second_program_with_the_spool_ends_and_says_who_has_it(tmp_path: Path) -> None:
    spool = Spool(folder := tmp_path / "default" / "a", LIMIT)
    ended = python("-m", "dropanchor_tag_client", "publish", "--tag", "a", "--spool", str(tmp_path))
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"dropanchor-tag: the spool {folder} is in use by process {os.getpid()} on ")
    spool.close()


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(SpoolError, match=r"file/spool cannot be used: Not a directory"):
        Spool(tmp_path / "file" / "spool", LIMIT)
    with pytest.raises(SpoolError, match="at least 1000000 bytes"):
        Spool(tmp_path, 10)
