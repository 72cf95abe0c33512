"""What the service answers about recordings."""

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.site import Id


class RecordingRequest(BaseModel):
    """What shall be recorded."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    tags: list[Id] | None = Field(default=None, max_length=10_000, description="Only these tags; null: all.")


class RecordingState(BaseModel):
    """Whether and what the service records."""

    model_config = ConfigDict(frozen=True)

    recording: bool
    since_ns: int | None = Field(default=None, description="UTC, ns.")
    tags: list[str] | None = Field(default=None, description="Null: all.")
    file: str | None = Field(default=None, description="The one that is being written, if there is any yet.")


class RecordedFile(BaseModel):
    """A file with a recording."""

    model_config = ConfigDict(frozen=True)

    name: str
    bytes: int
    changed_ns: int = Field(description="UTC, ns, when it was last written to.")
    finished: bool = Field(description="Whether it has its index: one that is still written, or was torn, has none.")


class RecordingList(RecordingState):
    """The state, and the files that there are."""

    files: list[RecordedFile] = Field(description="The oldest first.")
