"""The settings of what is kept: the history, the recordings and the black box."""

from pathlib import Path
from typing import Annotated
from urllib.parse import parse_qs, urlsplit

from pydantic import AfterValidator, Field, model_validator

from dropanchor_schemas.models import Exact
from dropanchor_service.settings.ids import SettingsId


def _is_database_url(url: str) -> str:
    """Return the URL. Raise ValueError where it is none of PostgreSQL, or holds a password, which logs might show."""
    parts = urlsplit(url)
    if parts.scheme not in ("postgresql", "postgres"):
        raise ValueError("an address that begins with postgresql:// was expected")
    if parts.password is not None or "password" in parse_qs(parts.query):
        raise ValueError("leave the password out: write it into a file, and name that in `password_file`")
    return url


class HistorySettings(Exact):
    """Where the history is, which poses it keeps, and for how long."""

    enabled: bool = Field(default=True, description="Whether to keep a history. It needs a `data_dir` or a `url`.")
    url: Annotated[str, AfterValidator(_is_database_url)] | None = Field(
        default=None,
        description="Database that keeps the history in place of a file in `data_dir`, such as "
        "`postgresql://dropanchor@db.example/history?sslmode=verify-full`, without a password. It needs the extra "
        "`postgresql`.",
    )
    password_file: Path | None = Field(
        default=None,
        description="File with the password of the database, without anything else. Not set: the password file of "
        "PostgreSQL's own library, or a login without password.",
    )
    period_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=1.0, description="Keep at most one pose of a tag per period."
    )
    distance_m: Annotated[float, Field(ge=0, le=1000)] = Field(
        default=0.1, description="Leave out a pose that is nearer than this to the one before and in the same state."
    )
    still_s: Annotated[float, Field(ge=0, le=3600)] = Field(
        default=5.0,
        description="But keep one after this time, even of a tag that stands. Beyond 10 s, no pose can be "
        "interpolated in between.",
    )
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = Field(default=30.0, description="Delete older poses.")
    max_mib: Annotated[float, Field(ge=1)] = Field(
        default=4096.0,
        description="Size of the history; the oldest poses make room. In a database: of all sites together.",
    )

    @model_validator(mode="after")
    def _password_is_for_a_database(self) -> "HistorySettings":
        if self.password_file is not None and self.url is None:
            raise ValueError("`password_file` is for a database: set `url` too")
        return self


class RecordingSettings(Exact):
    """What to record in `data_dir`/recordings, and for how long to keep it."""

    enabled: bool = Field(default=False, description="Record from the start; otherwise when REST asks for it.")
    tags: tuple[SettingsId, ...] = Field(default=(), description="Record only these tags from the start; empty: all.")
    pose_period_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=0.2, description="Record at most one pose of a tag per period. All samples are recorded."
    )
    file_mib: Annotated[float, Field(ge=0.01)] = Field(default=256.0, description="Finish a file that is larger.")
    file_minutes: Annotated[float, Field(gt=0)] = Field(default=60.0, description="Finish a file that is older.")
    keep_files: Annotated[int, Field(ge=1)] = Field(default=10_000, description="Number of files to keep.")
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = Field(default=30.0, description="Delete older files.")
    max_mib: Annotated[float, Field(ge=1)] = Field(
        default=16_384.0, description="Size of all files; the oldest make room."
    )


class BlackBoxSettings(Exact):
    """What all tags sent in the last hours, in `data_dir`/blackbox, so that the past can be explained."""

    enabled: bool = Field(default=True, description="Whether to keep it. It needs a `data_dir`.")
    keep_hours: Annotated[float, Field(gt=0, le=8760)] = Field(default=24.0, description="Delete what is older.")
    max_mib: Annotated[float, Field(ge=16)] = Field(
        default=2048.0, description="Size of the black box; the oldest makes room. It also does where the disk is full."
    )
