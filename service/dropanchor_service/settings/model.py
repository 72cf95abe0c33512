"""The settings of the service. `settings_sources` reads them; they are built once and passed down."""

import difflib
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_schemas.site import Site, TagSettings
from dropanchor_service.estimation.attitude import AttitudeParameters
from dropanchor_service.estimation.paper_parameters import TUNED, PaperParameters


def _is_endpoint(text: str) -> str:
    protocol, _, address = text.partition("/")
    if not protocol.isalnum() or ":" not in address or " " in text:
        raise ValueError("an endpoint such as tcp/127.0.0.1:7447 was expected")
    return text


def _is_tag_id(name: str) -> str:
    try:
        chunk_from_id(name)
    except InvalidKeyError as error:
        raise ValueError(str(error)) from error
    return name


def _as_list(value: Any) -> Any:
    """One endpoint, or several with commas between: what fits into an environment variable."""
    return [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value


Endpoints = Annotated[tuple[Annotated[str, AfterValidator(_is_endpoint)], ...], BeforeValidator(_as_list)]
TagId = Annotated[str, AfterValidator(_is_tag_id)]
Parameters = TypeVar("Parameters", PaperParameters, AttitudeParameters)
Port = Annotated[int, Field(ge=0, le=65535)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class HttpSettings(_Section):
    """Where the page and the REST interface are served."""

    host: str = Field(default="127.0.0.1", min_length=1)
    port: Port = Field(default=8080, description="0: any free port.")
    tls: bool = Field(
        default=True, description="False: plain HTTP although there is a certificate; a proxy is before it."
    )
    certificate: Path | None = Field(default=None, description="PEM, with its chain; else that of the credentials.")
    key: Path | None = Field(default=None, description="PEM, of the certificate.")
    requests_per_s: Annotated[float, Field(ge=0.1, le=1e6)] = Field(
        default=200.0, description="Of one key, token or address. On the loopback without credentials: no limit."
    )
    burst: Annotated[int, Field(ge=1, le=1_000_000)] = Field(default=400, description="So many at once.")

    @model_validator(mode="after")
    def _certificate_has_a_key(self) -> "HttpSettings":
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key go together: give both or neither")
        return self


class ZenohSettings(_Section):
    """Either a router of our own that listens, or a session that connects to one."""

    listen: Endpoints = Field(
        default=("tcp/127.0.0.1:7447",), description="With credentials: those endpoints unless others are given here."
    )
    connect: Endpoints = Field(default=(), description="Endpoints of a router; then `listen` is not used.")
    config_file: Path | None = Field(default=None, description="A Zenoh configuration (JSON5): TLS, access control.")


def is_safe_url(url: str) -> str:
    """Raises ValueError where others could change what comes from there."""
    if not url.startswith(("https://", "http://127.0.0.1:", "http://localhost:")):
        raise ValueError("an address that begins with https:// was expected")
    return url


SafeUrl = Annotated[str, AfterValidator(is_safe_url)]


class OidcSettings(_Section):
    """An OpenID Connect provider whose access tokens are taken over REST."""

    issuer: SafeUrl
    audience: str = Field(min_length=1, description="What `aud` of a token has to name.")
    jwks_url: SafeUrl | None = Field(default=None, description="Else it is asked for at the issuer (discovery).")
    scope_claim: str = Field(default="scope", description="Where a token says its scopes; dots lead into objects.")
    scopes: dict[Literal["read", "write", "admin"], str] = Field(
        default={"read": "dropanchor:read", "write": "dropanchor:write", "admin": "dropanchor:admin"},
        description="What the provider calls ours.",
    )


class SecuritySettings(_Section):
    """Who is let in. With neither, anybody is, and then only on the loopback unless `insecure` is set."""

    folder: Path | None = Field(
        default=None, description="Made by `dropanchor security init`: certificates, access control, API keys."
    )
    oidc: OidcSettings | None = None


class IngestSettings(_Section):
    """How samples come in."""

    period_ms: Annotated[float, Field(gt=0, le=1000)] = Field(
        default=20.0, description="Samples that come in within so long are fused together."
    )
    reorder_ms: Annotated[float, Field(ge=0, le=10_000)] = Field(
        default=250.0, description="A message waits at most so long for those that its publisher numbered before it."
    )
    max_wait_ms: Annotated[float, Field(ge=10, le=60_000)] = Field(
        default=500.0,
        description="When live messages wait longer than this, and ever longer, the older ones of each tag are shed.",
    )
    buffer_mib: Annotated[float, Field(gt=0, le=4096)] = Field(
        default=64.0, description="Messages that may wait; beyond it the oldest of the busiest tags are shed."
    )


class HistorySettings(_Section):
    """Which poses are kept in `data_dir`, and for how long."""

    enabled: bool = Field(default=True, description="Without a `data_dir` there is no history.")
    period_s: Annotated[float, Field(gt=0, le=3600)] = Field(default=1.0, description="At most one pose in so long.")
    distance_m: Annotated[float, Field(ge=0, le=1000)] = Field(
        default=0.1, description="A pose nearer than this to the one before it, in the same state, is left out,"
    )
    still_s: Annotated[float, Field(ge=0, le=3600)] = Field(
        default=5.0, description="unless so long has passed. Beyond 10 s no pose at a past time can be given between."
    )
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 30.0
    most_mib: Annotated[float, Field(ge=1)] = Field(default=4096.0, description="The oldest poses make room.")


class RecordingSettings(_Section):
    """What is recorded in `data_dir`/recordings, and for how long."""

    enabled: bool = Field(default=False, description="Record from the start; else when REST asks for it.")
    tags: tuple[TagId, ...] = Field(default=(), description="Only these tags, when it records from the start.")
    pose_period_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=0.2, description="At most one pose of a tag in so long; samples are recorded all."
    )
    file_mib: Annotated[float, Field(ge=0.01)] = Field(default=256.0, description="A file that is larger is finished.")
    file_minutes: Annotated[float, Field(gt=0)] = Field(default=60.0, description="So is one that is older.")
    keep_files: Annotated[int, Field(ge=1)] = 10_000
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 30.0
    most_mib: Annotated[float, Field(ge=1)] = Field(default=16_384.0, description="The oldest files make room.")


class PaperSettings(_Section):
    """Parameters of the engine `paper`; names, units and sources stand in `estimation/paper_parameters.py`."""

    preset: Literal["published", "tuned"] = Field(
        default="published", description="The paper's and its authors' values, or ours for realistic noise."
    )
    parameters: dict[str, float] = Field(default={}, description="Single parameters that differ from the preset.")
    attitude: dict[str, float] = Field(default={}, description="The same for the attitude filter.")

    @model_validator(mode="after")
    def _parameters_exist(self) -> "PaperSettings":
        self.values()
        return self

    def values(self) -> PaperParameters:
        """Raises ValueError for a name that is no parameter."""
        preset = {"published": PaperParameters(), "tuned": TUNED}[self.preset]
        attitude = _replaced(preset.attitude, self.attitude)
        return replace(_replaced(preset, self.parameters), attitude=attitude)


def _replaced(preset: Parameters, changes: Mapping[str, float]) -> Parameters:
    numbers = {
        f.name: type(getattr(preset, f.name))
        for f in fields(preset)
        if isinstance(getattr(preset, f.name), int | float)
    }
    for name in changes:
        if name not in numbers:
            close = difflib.get_close_matches(name, numbers, 1)
            raise ValueError(f"{name} is not a parameter" + (f"; did you mean {close[0]}?" if close else ""))
    return replace(preset, **{name: numbers[name](value) for name, value in changes.items()})


class Settings(_Section):
    """Everything that can be set. Built once, at the start, and passed down."""

    engine: Literal["fleet", "paper"] = Field(
        default="fleet", description="The estimator: ours, or Algorithm 1 as published."
    )
    data_dir: Path | None = Field(
        default=None,
        description="Where changes made over REST, tracks and checkpoints are kept; without it a restart forgets all.",
    )
    checkpoint_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=0.5, description="From one checkpoint to the next: what a killed service has to make up for."
    )
    unknown_tags: Literal["accept", "quarantine", "refuse"] = Field(
        default="accept",
        description="Whether a tag that is not listed here gets a row when it is heard; quarantine: once somebody has "
        "put its settings, until then it is listed under newcomers.",
    )
    unproven_tags: Annotated[int, Field(ge=0, le=1_000_000)] = Field(
        default=200,
        description="So many accepted tags may have a row that were heard no more than once; if there are more, a tag "
        "gets one with its second message.",
    )
    max_tags: Annotated[int, Field(ge=1, le=1_000_000)] = 20_000
    insecure: bool = Field(default=False, description="Listen beyond the loopback although anybody may then connect.")
    http: HttpSettings = HttpSettings()
    zenoh: ZenohSettings = ZenohSettings()
    security: SecuritySettings = SecuritySettings()
    ingest: IngestSettings = IngestSettings()
    history: HistorySettings = HistorySettings()
    recording: RecordingSettings = RecordingSettings()
    site: Site = Site()
    tags: dict[TagId, TagSettings] = {}
    paper: PaperSettings = PaperSettings()

    @model_validator(mode="after")
    def _listed_tags_fit(self) -> "Settings":
        if len(self.tags) > self.max_tags:
            raise ValueError(f"max_tags is {self.max_tags}, but {len(self.tags)} tags are listed")
        return self
