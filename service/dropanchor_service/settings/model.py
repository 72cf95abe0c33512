"""The settings of the service. `sources` reads them; they are built once and passed down."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, model_validator

from dropanchor_schemas.site import Site, TagSettings
from dropanchor_service.estimation.paper.attitude import AttitudeParameters
from dropanchor_service.estimation.paper.parameters import TUNED, PaperParameters
from dropanchor_service.settings.basemap import BasemapSettings
from dropanchor_service.settings.buckets import refuse_unfit_buckets
from dropanchor_service.settings.cluster import ClusterSettings
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, EventSettings, MqttSettings
from dropanchor_service.settings.history import BlackBoxSettings, HistorySettings, RecordingSettings
from dropanchor_service.settings.http import HttpSettings
from dropanchor_service.settings.ids import SettingsId, SiteId
from dropanchor_service.settings.layers import Layer
from dropanchor_service.settings.lists import as_list
from dropanchor_service.settings.quota import Quota, UnknownTags
from dropanchor_service.settings.sites import ScopeName, SiteSettings


def _is_endpoint(text: str) -> str:
    protocol, _, address = text.partition("/")
    if not protocol.isalnum() or ":" not in address or " " in text:
        raise ValueError("an endpoint such as tcp/127.0.0.1:7447 was expected")
    return text


Endpoints = Annotated[tuple[Annotated[str, AfterValidator(_is_endpoint)], ...], BeforeValidator(as_list)]
Parameters = TypeVar("Parameters", PaperParameters, AttitudeParameters)


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ZenohSettings(_Section):
    """Either the service opens a router that listens, or it connects to one."""

    listen: Endpoints = Field(
        default=("tcp/127.0.0.1:7447",),
        description="Endpoints of the service's own router. With credentials, those of its configuration unless "
        "you set others here.",
    )
    connect: Endpoints = Field(default=(), description="Endpoints of a router to connect to; `listen` is then ignored.")
    config_file: Path | None = Field(default=None, description="A Zenoh configuration (JSON5) to use instead.")


def is_safe_url(url: str) -> str:
    """Return the URL. Raise ValueError where others could change what comes from there."""
    if not url.startswith(("https://", "http://127.0.0.1:", "http://localhost:")):
        raise ValueError("an address that begins with https:// was expected")
    return url


SafeUrl = Annotated[str, AfterValidator(is_safe_url)]


class OidcSettings(_Section):
    """An OpenID Connect provider whose access tokens REST accepts."""

    issuer: SafeUrl = Field(description="The provider's address, as its tokens name it.")
    audience: str = Field(min_length=1, description="What the claim `aud` of a token must name.")
    jwks_url: SafeUrl | None = Field(
        default=None, description="Where the provider's keys are; without it, the issuer is asked."
    )
    scope_claim: str = Field(default="scope", description="The claim that holds the scopes; dots lead into objects.")
    scopes: dict[ScopeName, str] = Field(
        default={"read": "dropanchor:read", "write": "dropanchor:write", "admin": "dropanchor:admin"},
        description="The provider's names of our scopes.",
    )


class SecuritySettings(_Section):
    """Who is let in. With neither of these anybody is, and the service listens on the loopback only."""

    folder: Path | None = Field(
        default=None,
        description="The folder that `dropanchor security init` made: certificates, access control, API keys.",
    )
    oidc: OidcSettings | None = None


class IngestSettings(_Section):
    """How samples come in."""

    period_ms: Annotated[float, Field(gt=0, le=1000)] = Field(
        default=20.0,
        description="Period of the ingest: samples that arrive within it are fused together. While few messages come, "
        "it grows up to 7.5 times, but to 150 ms and three quarters of the time for which tags gather samples at most.",
    )
    reorder_ms: Annotated[float, Field(ge=0, le=10_000)] = Field(
        default=250.0, description="How long a message waits for missing ones that its publisher numbered before it."
    )
    max_lag_s: Annotated[float, Field(ge=0.25, le=10)] = Field(
        default=3.5,
        description="How long the ranges of a tag wait at most for its IMU samples, once these have been seen to "
        "arrive in batches, as phones post them. Its poses come that much later. 0.25: never longer than usual.",
    )
    max_wait_ms: Annotated[float, Field(ge=10, le=60_000)] = Field(
        default=500.0,
        description="When live messages wait longer than this, and longer and longer, each tag loses its oldest ones.",
    )
    buffer_mib: Annotated[float, Field(gt=0, le=4096)] = Field(
        default=64.0,
        description="Memory for waiting messages. When it is full, the busiest tags lose their oldest ones.",
    )


class PaperSettings(_Section):
    """Parameters of the engine `paper`; `estimation/paper/parameters.py` gives names, units and sources."""

    preset: Literal["published", "tuned"] = Field(
        default="published", description="The values of the paper and its authors, or values for realistic noise."
    )
    parameters: dict[str, float] = Field(default={}, description="Single parameters that differ from the preset.")
    attitude: dict[str, float] = Field(default={}, description="The same for the attitude filter.")

    @model_validator(mode="after")
    def _parameters_exist(self) -> "PaperSettings":
        self.values()
        return self

    def values(self) -> PaperParameters:
        """Return the parameters of the engine. Raise ValueError for an unknown name."""
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
    """Keys outside of any section."""

    engine: Literal["fleet", "paper"] = Field(
        default="fleet", description="The estimator: the default, or Algorithm 1 as published."
    )
    engine_threads: Annotated[int, Field(ge=1, le=256)] | Literal["auto"] = Field(
        default="auto",
        description="Threads that share the tags. auto: one for each processor that the process may use, by its "
        "affinity and the quota of its control group. The poses are the same to the last bit. `paper` has one thread.",
    )
    data_dir: Path | None = Field(
        default=None,
        description="Folder for changes made over REST, history, recordings and checkpoints. Without it, a restart "
        "forgets everything.",
    )
    checkpoint_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=1.0,
        description="Time between checkpoints: what a killed service has to fetch again. It is longer, up to 6 s, "
        "while many tags move, which spares memory cards.",
    )
    unknown_tags: UnknownTags = Field(
        default="accept",
        description="What to do with a tag that is not listed here. In quarantine it waits, listed as pending, "
        "until somebody puts its settings.",
    )
    max_unconfirmed_tags: Annotated[int, Field(ge=0, le=1_000_000)] = Field(
        default=200,
        description="How many unlisted tags may have an estimator after one message. Beyond that, a new tag gets one "
        "with its second message.",
    )
    max_tags: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=20_000, description="Tags that may be admitted. Of several sites, in each."
    )
    insecure: bool = Field(
        default=False, description="Listen on the network without credentials: anybody may then connect."
    )
    http: HttpSettings = HttpSettings()
    zenoh: ZenohSettings = ZenohSettings()
    security: SecuritySettings = SecuritySettings()
    ingest: IngestSettings = IngestSettings()
    history: HistorySettings = HistorySettings()
    recording: RecordingSettings = RecordingSettings()
    blackbox: BlackBoxSettings = BlackBoxSettings()
    events: EventSettings = EventSettings()
    delivery: DeliverySettings = DeliverySettings()
    email: EmailSettings = EmailSettings()
    mqtt: MqttSettings = MqttSettings()
    basemap: BasemapSettings = BasemapSettings()
    cluster: ClusterSettings = ClusterSettings()
    site: Site = Site()
    tags: dict[SettingsId, TagSettings] = {}
    tag_defaults: TagSettings = Field(
        default=TagSettings(), description="What every tag gets, unless its own table says otherwise."
    )
    sites: dict[SiteId, SiteSettings] = Field(
        default={}, description="A site of several in one process, in place of `[site]` and `[tags]`."
    )
    paper: PaperSettings = PaperSettings()
    _layers: Sequence[Layer] = PrivateAttr(default=())

    def loaded_from(self, layers: Sequence[Layer]) -> Self:
        """Note where the settings come from, in ascending priority."""
        self._layers = layers
        return self

    @property
    def layers(self) -> Sequence[Layer]:
        return self._layers

    @property
    def of_replays(self) -> dict[str, str]:
        """What a replay of samples needs of the settings, beside the site."""
        return {
            "engine": self.engine,
            "paper": self.paper.model_dump_json(),
            "ingest": self.ingest.model_dump_json(),
        }

    @property
    def quota(self) -> Quota:
        """Which tags a site admits, unless its own table says otherwise."""
        return Quota(self.unknown_tags, self.max_unconfirmed_tags, self.max_tags)

    @property
    def listed_tags(self) -> dict[str, TagSettings]:
        """The settings of the tags that are listed, with the defaults where their tables say nothing."""
        return {name: tag.over(self.tag_defaults) for name, tag in self.tags.items()}

    @model_validator(mode="after")
    def _listed_tags_fit(self) -> "Settings":
        if len(self.tags) > self.max_tags:
            raise ValueError(f"max_tags is {self.max_tags}, but {len(self.tags)} tags are listed")
        return self

    @property
    def site_ids(self) -> list[str]:
        """The ids of all sites."""
        return list(self.sites) or [self.site.id]

    @model_validator(mode="after")
    def _buckets_fit(self) -> "Settings":
        if self.cluster.url is not None:
            refuse_unfit_buckets(self.site_ids, self.cluster.bucket)
        return self

    @model_validator(mode="after")
    def _sites_fit(self) -> "Settings":
        if self.sites and {"site", "tags"} & self.model_fields_set:
            raise ValueError("[site] and [tags] are of an only site: move them into the tables of [sites]")
        for name, site in self.sites.items():
            site.require_fit(name, self.quota)
            if site.oidc_scopes and self.security.oidc is None:
                raise ValueError(f"oidc_scopes of the site {name!r} needs a provider: set [security.oidc]")
        return self
