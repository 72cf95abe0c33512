"""A recording that was stopped is finished: its file is whole when the answer comes, or refused until it is."""

import threading
from itertools import count
from pathlib import Path

import pytest
from mcap.reader import make_reader

from dropanchor_schemas.wire import ENCODING_PACKED
from dropanchor_service.api.routes import recordings
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.mcap_file import McapFile
from dropanchor_service.recording.recorder import Recorder
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench
from support.zenoh_router import wait_until

LIMITS = Limits(2**30, 10**18, 1000, 10**18, 2**40)


@pytest.fixture
def bench(tmp_path: Path) -> ApiBench:
    bench = make_api_bench()
    answers = bench.answers
    answers.tags.register("a")
    bench.recorder = Recorder(tmp_path, LIMITS, 1, answers.tags, answers.site, count(T_NS, 10**9).__next__, {})
    return bench


def test_the_file_is_whole_when_the_answer_to_stop_comes(bench: ApiBench, tmp_path: Path) -> None:
    app, recorder = bench.app(), bench.recorder
    assert recorder is not None
    with recorder:
        for _ in range(2):
            ask(app, "POST", "/api/v1/recordings", json={})
            recorder.record_messages([(0, b"payload", ENCODING_PACKED, T_NS)] * 1000)
            name = ask(app, "POST", "/api/v1/recordings/stop").json()["file"]
            (tmp_path / "got.mcap").write_bytes(ask(app, "GET", f"/api/v1/recordings/{name}").content)
            with (tmp_path / "got.mcap").open("rb") as file:
                summary = make_reader(file).get_summary()
            assert summary is not None
            assert summary.statistics is not None
            assert summary.statistics.message_count > 1000


def test_a_file_whose_end_is_not_on_the_disk_is_refused_and_not_torn(
    bench: ApiBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    app, recorder, is_full = bench.app(), bench.recorder, True
    assert recorder is not None
    finish = McapFile.finish

    def full(file: McapFile) -> None:
        if is_full:
            raise OSError(28, "No space left on device")
        finish(file)

    monkeypatch.setattr(McapFile, "finish", full)
    monkeypatch.setattr(recordings, "FINISH_S", 0.2)
    with recorder:
        ask(app, "POST", "/api/v1/recordings", json={})
        recorder.record_messages([(0, b"payload", ENCODING_PACKED, T_NS)])
        stopped = ask(app, "POST", "/api/v1/recordings/stop").json()
        download = ask(app, "GET", f"/api/v1/recordings/{stopped['file']}")
        assert kind_of(download) == "recording-unfinished"
        assert "disk" in download.json()["detail"]
        is_full = False
        wait_until(lambda: ask(app, "GET", f"/api/v1/recordings/{stopped['file']}").status_code == 200)


def test_nothing_is_recorded_behind_the_end(bench: ApiBench) -> None:
    """Otherwise what the ingest queues late would open another file, which nobody finishes."""
    recorder = bench.recorder
    assert recorder is not None
    with recorder:
        for _ in range(5):
            recorder.start()
            stopped = threading.Event()

            def record(stopped: threading.Event = stopped) -> None:
                while not stopped.wait(1e-4):
                    recorder.record_messages([(0, b"payload", ENCODING_PACKED, T_NS)])

            ingest = threading.Thread(target=record)
            ingest.start()
            recorder.stop(10.0)
            stopped.set()
            ingest.join()
            recorder.writer.wake()
            assert recorder.open_name is None
    assert all(file.finished for file in recorder.files())
