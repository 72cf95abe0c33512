"""`dropanchor record` as a user calls it, against a real server."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from dropanchor_schemas.wire import ENCODING_PACKED
from dropanchor_service.cli import main
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.recorder import Recorder
from support.api import ApiBench, make_api_bench
from support.http_server import running_server
from support.zenoh_router import free_port, wait_until


@pytest.fixture
def bench(tmp_path: Path) -> ApiBench:
    bench = make_api_bench()
    answers = bench.answers
    answers.tags.register("a")
    limits = Limits(2**30, 10**18, 1000, 10**18, 2**40)
    bench.recorder = Recorder(tmp_path, limits, 1, answers.tags, answers.site, answers.now_ns, {})
    return bench


@pytest.fixture
def url(bench: ApiBench) -> Iterator[str]:
    with running_server(bench.app(), bench.stopping) as port:
        wait_until(lambda: _listens(port))
        yield f"http://127.0.0.1:{port}"


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_a_recording_is_started_stopped_listed_and_fetched(
    bench: ApiBench, url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = bench.recorder
    assert recorder is not None
    assert main(["record", "start", "a", "b", "--url", url]) == 0
    recorder.record_messages([(0, b"payload", ENCODING_PACKED, bench.now_ns)])
    recorder.writer.flush()
    assert main(["record", "stop", "--url", url]) == 0
    recorder.writer.flush()
    (file,) = recorder.files()
    assert main(["record", "list", "--url", url]) == 0
    assert main(["record", "fetch", file.name, "--url", url, "--out", str(tmp_path / "copy")]) == 0
    assert (tmp_path / "copy").read_bytes() == (recorder.folder / file.name).read_bytes()
    said = capsys.readouterr().out.splitlines()
    assert said[:2] == ["recording a, b", f"stopped: {file.name}"]
    assert said[2:] == [f"{file.name}  0.0 MiB", "not recording", str(tmp_path / "copy")]


def test_what_cannot_be_done_is_said_in_a_sentence(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["stop"], ["fetch", "../site.json"]):
        assert main(["record", *arguments, "--url", url]) == 2
    nobody = f"http://127.0.0.1:{free_port()}"
    assert main(["record", "list", "--url", nobody]) == 2
    assert main(["record", "list", "--url", "nonsense"]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert errors[0] == "dropanchor record: No recording is running, so there is nothing to stop."
    assert "does not answer" in errors[2]
    assert len(errors) == 4
