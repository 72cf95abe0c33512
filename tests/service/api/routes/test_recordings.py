"""Recordings over REST."""

import os
from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas.recordings import RecordingList, RecordingState
from dropanchor_schemas.wire import ENCODING_PACKED
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.recorder import Recorder
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench

LIMITS = Limits(2**30, 10**18, 1000, 10**18, 2**40)


@pytest.fixture
def bench(tmp_path: Path) -> ApiBench:
    bench = make_api_bench()
    answers = bench.answers
    answers.tags.register("a")
    bench.recorder = Recorder(tmp_path, LIMITS, 1, answers.tags, answers.site, answers.now_ns, {})
    return bench


@pytest.mark.parametrize("wanted", [{}, {"tags": None}, {"tags": []}])
def test_a_recording_of_no_named_tags_is_one_of_all_tags(wanted: dict[str, Any], bench: ApiBench) -> None:
    app, recorder = bench.app(), bench.recorder
    assert recorder is not None
    started = ask(app, "POST", "/api/v1/recordings", json=wanted)
    assert (started.status_code, started.json()["tags"]) == (201, None)
    recorder.record_messages([(0, b"payload", ENCODING_PACKED, T_NS)])
    recorder.writer.flush()
    assert recorder.written == 1


def test_a_recording_is_started_stopped_listed_and_downloaded(bench: ApiBench) -> None:
    app, recorder = bench.app(), bench.recorder
    assert recorder is not None
    started = ask(app, "POST", "/api/v1/recordings", json={"tags": ["a"]})
    assert started.status_code == 201
    assert RecordingState.model_validate(started.json()) == RecordingState(recording=True, since_ns=T_NS, tags=["a"])
    assert kind_of(ask(app, "POST", "/api/v1/recordings", json={})) == "records-already"
    recorder.record_messages([(0, b"payload", ENCODING_PACKED, T_NS)])
    recorder.writer.flush()
    listed = RecordingList.model_validate(ask(app, "GET", "/api/v1/recordings").json())
    assert listed.file == listed.files[0].name
    assert not listed.files[0].finished
    assert ask(app, "POST", "/api/v1/recordings/stop").json()["recording"] is False
    recorder.writer.flush()
    assert kind_of(ask(app, "POST", "/api/v1/recordings/stop")) == "records-nothing"
    file = RecordingList.model_validate(ask(app, "GET", "/api/v1/recordings").json()).files[0]
    download = ask(app, "GET", f"/api/v1/recordings/{file.name}")
    assert file.finished
    assert download.content == (recorder.folder / file.name).read_bytes()
    assert download.headers["content-disposition"] == f'attachment; filename="{file.name}"'


@pytest.mark.parametrize("name", ["x.mcap", "..%2Fsite.json", "%2Fetc%2Fpasswd", "..", "x"])
def test_only_recordings_can_be_downloaded(bench: ApiBench, name: str, tmp_path: Path) -> None:
    (tmp_path / "site.json").write_text("{}")
    assert ask(bench.app(), "GET", f"/api/v1/recordings/{name}").status_code == 404


def test_a_link_in_the_folder_is_neither_listed_nor_served(bench: ApiBench, tmp_path: Path) -> None:
    assert bench.recorder is not None
    bench.recorder.prepare()
    folder, secret = bench.recorder.folder, tmp_path / "ca.key"
    secret.write_text("secret")
    (folder / "link.mcap").symlink_to(secret)
    (folder / "dangling.mcap").symlink_to(tmp_path / "nothing")
    (folder / "folder.mcap").mkdir()
    os.mkfifo(folder / "pipe.mcap")
    (folder / "real.mcap").write_text("real")
    app = bench.app()
    assert [file["name"] for file in ask(app, "GET", "/api/v1/recordings").json()["files"]] == ["real.mcap"]
    for name in ("link", "dangling", "folder", "pipe"):
        assert kind_of(ask(app, "GET", f"/api/v1/recordings/{name}.mcap")) == "unknown-recording"
    assert ask(app, "GET", "/api/v1/recordings/real.mcap").content == b"real"


def test_recording_needs_a_data_folder() -> None:
    app = make_api_bench().app()
    for method, path in (("GET", ""), ("POST", "/stop"), ("GET", "/x.mcap")):
        assert kind_of(ask(app, method, f"/api/v1/recordings{path}")) == "no-recorder"
    assert kind_of(ask(app, "POST", "/api/v1/recordings", json={})) == "no-recorder"


def test_a_folder_that_cannot_be_created_is_reported_at_once(bench: ApiBench, tmp_path: Path) -> None:
    (tmp_path / "recordings").write_text("in the way")
    assert kind_of(ask(bench.app(), "POST", "/api/v1/recordings", json={})) == "not-saved"
