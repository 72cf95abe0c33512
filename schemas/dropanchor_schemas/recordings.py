"""Models of requests and answers about recordings."""

from pydantic import Field

from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.site import Id


class RecordingRequest(Exact):
    """Which tags to record."""

    tags: list[Id] | None = Field(
        default=None, max_length=10_000, description="The tags to record; null or empty: all."
    )


class RecordingState(Frozen):
    """Whether the service is recording, and what."""

    recording: bool
    since_ns: int | None = Field(default=None, description="UTC, ns: when the recording started.")
    tags: list[str] | None = Field(default=None, description="The recorded tags; null for all tags.")
    file: str | None = Field(default=None, description="The current file; null until the first one is created.")


class RecordedFile(Frozen):
    """A recording file."""

    name: str
    bytes: int
    changed_ns: int = Field(description="UTC, ns: the time of the last write.")
    finished: bool = Field(description="Whether the file is complete and has its index; false while it is written.")


class RecordingList(RecordingState):
    """The recording state and all recording files."""

    files: list[RecordedFile] = Field(description="All files, oldest first.")
