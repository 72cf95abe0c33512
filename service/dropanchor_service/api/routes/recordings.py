"""The routes that start, stop, list and download recordings."""

import os
from collections.abc import Iterator
from typing import Annotated, Any, BinaryIO

from fastapi import Body, Path, Request
from starlette.responses import Response, StreamingResponse

from dropanchor_schemas.recordings import RecordingList, RecordingRequest, RecordingState
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.contents import BYTES
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response, saving
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.recording.recorder import Recorder

MEDIA_TYPE = "application/octet-stream"
CHUNK_BYTES = 262_144
FINISH_S = 10.0
FileName = Annotated[
    str,
    Path(
        description="The name of the file, as in the list of recordings.",
        examples=["yard-20270115T080000-000000Z.mcap"],
    ),
]


def _file() -> dict[int | str, dict[str, Any]]:
    return {200: {"content": {MEDIA_TYPE: BYTES}}}


router = Router(tags=["recordings"], dependencies=[NO_QUERY])


@router.get(
    "/recordings",
    summary="Get the state of the recorder and the list of files",
    response_model=RecordingList,
    responses=example_response(examples.RECORDINGS) | problems(Kind.NO_RECORDER, Kind.INVALID_REQUEST),
)
def list_recordings(request: Request) -> Response:
    found = _required(request)
    files = [
        {"name": file.name, "bytes": file.size, "changed_ns": file.changed_ns, "finished": file.finished}
        for file in found.files()
    ]
    return json_response(_state(found) | {"files": files})


@router.post(
    "/recordings",
    summary="Start a recording of raw samples and poses",
    status_code=201,
    response_model=RecordingState,
    responses=example_response(examples.RECORDING, 201)
    | problems(*(Kind.NO_RECORDER, Kind.RECORDS_ALREADY, Kind.INVALID_REQUEST, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED)),
)
def start_recording(wanted: Annotated[RecordingRequest, Body(examples=[{"tags": None}])], request: Request) -> Response:
    found = _required(request)
    with saving():
        found.prepare()
    if not found.start(wanted.tags):
        raise ProblemError(
            Kind.RECORDS_ALREADY, "A recording is running. Stop it first with POST /api/v1/recordings/stop."
        )
    return json_response(_state(found), status=201)


@router.post(
    "/recordings/stop",
    summary="Stop the recording",
    response_model=RecordingState,
    description="The answer names the last `file`. It comes when the file is finished, at the latest after 10 s.",
    responses=example_response(examples.NO_RECORDING)
    | problems(Kind.NO_RECORDER, Kind.RECORDS_NOTHING, Kind.INVALID_REQUEST),
)
def stop_recording(request: Request) -> Response:
    found = _required(request)
    if not found.stop(FINISH_S):
        raise ProblemError(Kind.RECORDS_NOTHING, "No recording is running, so there is nothing to stop.")
    return json_response(_state(found) | {"file": found.open_name or found.ended_name})


@router.get(
    "/recordings/{name}",
    summary="Download a recording, to replay it or to open it in Foxglove or Lichtblick",
    response_class=StreamingResponse,
    description="The file of a running recording comes up to where it is, without its index.",
    responses=_file()
    | problems(Kind.NO_RECORDER, Kind.UNKNOWN_RECORDING, Kind.RECORDING_UNFINISHED, Kind.INVALID_REQUEST),
)
def get_recording(name: FileName, request: Request) -> Response:
    return _download(_opened(_required(request), name), name)


def _opened(recorder: Recorder, name: str) -> BinaryIO:
    """Open the recording with this name. Raises ProblemError."""
    if recorder.running is None and recorder.open_name == name:
        raise ProblemError(
            Kind.RECORDING_UNFINISHED,
            f"{name} is not finished yet: its end is not on the disk. Try again in a second; if it stays so, "
            "GET /api/v1/health/ready says what is wrong with the disk.",
        )
    file = recorder.opened(name)  # none if the retention limit deleted it meanwhile
    if file is None:
        raise ProblemError(
            Kind.UNKNOWN_RECORDING, f"There is no recording {name!r}. GET /api/v1/recordings lists the files."
        )
    return file


def _download(file: BinaryIO, name: str) -> Response:
    """Return the file up to its current size, since it may still grow."""
    size = os.fstat(file.fileno()).st_size
    headers = {
        "cache-control": "no-store",
        "content-disposition": f'attachment; filename="{name}"',
        "content-length": str(size),
    }
    return StreamingResponse(_chunks(file, size), media_type=MEDIA_TYPE, headers=headers)


def _chunks(file: BinaryIO, size: int) -> Iterator[bytes]:
    with file:
        while size > 0 and (chunk := file.read(min(size, CHUNK_BYTES))):
            size -= len(chunk)
            yield chunk


def _required(request: Request) -> Recorder:
    recorder = parts_of(request).recorder
    if recorder is None:
        raise ProblemError(Kind.NO_RECORDER, "Set `data_dir`, where the service stores recordings.")
    return recorder


def _state(recorder: Recorder) -> dict[str, Any]:
    running = recorder.running
    if running is None:
        return {"recording": False, "since_ns": None, "tags": None, "file": recorder.open_name}
    tags = None if running.tags is None else list(running.tags)
    return {"recording": True, "since_ns": running.since_ns, "tags": tags, "file": recorder.open_name}
