"""Models of requests and answers about recordings."""

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.site import Id


class RecordingRequest(BaseModel):
    """Which tags to record."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    tags: list[Id] | None = Field(
        default=None, max_length=10_000, description="The tags to record; null or empty: all."
    )


class RecordingState(BaseModel):
    """Whether the service is recording, and what."""

    model_config = ConfigDict(frozen=True)

    recording: bool
    since_ns: int | None = Field(default=None, description="UTC, ns: when the recording started.")
    tags: list[str] | None = Field(default=None, description="The recorded tags; null for all tags.")
    file: str | None = Field(default=None, description="The current file; null until the first one is created.")


class RecordedFile(BaseModel):
    """A recording file."""

    model_config = ConfigDict(frozen=True)

    name: str
    bytes: int
    changed_ns: int = Field(description="UTC, ns: the time of the last write.")
    finished: bool = Field(description="Whether the file is complete and has its index; false while it is written.")


class RecordingList(RecordingState):
    """The recording state and all recording files."""

    files: list[RecordedFile] = Field(description="All files, oldest first.")
