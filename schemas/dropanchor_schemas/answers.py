"""Models of the service's answers other than poses: tags, anchors, lists and problems."""

from typing import Literal

from pydantic import Field

from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.pose import Phrase, TrackingState
from dropanchor_schemas.site import Anchor, Georeference, RemoteSettings, TagSettings
from dropanchor_schemas.tag_health import Care, TagHealth


class RemoteSettingsStatus(Frozen):
    """What the service has set for the program of a tag, and what the program says that it applies."""

    wanted: RemoteSettings
    acknowledged: RemoteSettings | None = Field(description="null: the program has acknowledged no settings.")


class MotionOffset(Frozen):
    """The same offset, from the turns and stops that the motion and the ranges of a moving tag both show.

    Delays of messages do not change it.
    """

    offset_s: float = Field(description="Negative: the clock of the motion is behind. Found from the last 100 s.")
    uncertainty_s: float = Field(description="With 95 % probability, the offset lies within this much of it.")


class ClockOffset(Frozen):
    """How far the clock of a tag's motion is ahead of that of its ranges."""

    offset_s: float = Field(
        description="Negative: behind. Found from the messages with the least delay in the last 30 to 60 s, so that a "
        "network that delays all messages of one side by this much looks the same."
    )
    uncertainty_s: float = Field(description="The offset lies within this much of it.")
    from_motion: MotionOffset | None = Field(
        description="A second estimate; null while the tag does not move, or its motion does not tell."
    )
    corrected: bool = Field(description="Whether the service moves the times of the motion by the offset.")


class TagStatus(Frozen):
    """The status of one tag: when it last sent data, what was received from it, and its settings."""

    tag: str
    online: bool = Field(
        description="Whether the tag's liveliness token is present, its WebSocket is open, or it has sent something "
        "over HTTP in the last 30 s."
    )
    first_heard_ns: int | None = Field(description="UTC, ns; null if the tag has sent nothing yet.")
    last_heard_ns: int | None
    messages: int
    samples: dict[str, int] = Field(description="Samples that the engine was given, by kind.")
    arrived: dict[str, int] = Field(default={}, description="Samples that arrived in readable messages, by kind.")
    used: dict[str, int] = Field(default={}, description="Samples that the engine used, by kind.")
    rejected: dict[str, int] = Field(description="Messages and samples that were not used, by reason.")
    lag_s: float = Field(
        default=0.0,
        description="How late the poses come at most, because the tag's IMU samples arrive in batches and its ranges "
        "wait for them; 0 for a tag whose samples come in time.",
    )
    hint: str = Field(
        description="What an operator can do about rejected data, for example add a missing anchor to the site; empty "
        "if nothing needs to be done."
    )
    hint_phrase: Phrase | None = Field(default=None, description="The hint by its code; null without one.")
    unknown_anchor: str | None = Field(
        description="An anchor that the tag ranges to although the site does not have it; null if there is none."
    )
    health: TagHealth | None = Field(description="What the tag has reported about itself; null if nothing.")
    clock_offset: ClockOffset | None = Field(
        description="null: one program sends motion and ranges and stamps both by one clock, or one of them has not "
        "come for a minute."
    )
    clock_error_s: float | None = Field(
        default=None,
        description="How far the clock of the tag is ahead of UTC, which the service corrects; negative: behind. null: "
        "it is right as far as the service knows, or counts from boot.",
    )
    needs_care: list[Care] = Field(description="What a person should do for the tag; empty if nothing.")
    remote_settings: RemoteSettingsStatus
    settings: TagSettings


class TimedTagStatus(TagStatus):
    """The status of one tag, whose times people can read, too."""

    first_heard_utc: str | None = Field(description="`first_heard_ns` as ISO 8601.")
    last_heard_utc: str | None = Field(description="`last_heard_ns` as ISO 8601.")


class ClientAccess(Frozen):
    """What the client of this request may do."""

    scope: Literal["read", "write", "admin"] = Field(
        description="read: read; write: also set anchors and tags; admin: also delete, and replace the site."
    )


class SamplesReceived(Frozen):
    """What was taken in. Admission, duplicates and the values of samples are judged later: see the tag's counters."""

    samples: int = Field(description="Samples in the payload.")


class HealthReceived(Frozen):
    """What was taken in of a tag's health. Whether the tag is admitted is judged later: see the tag's counters."""

    values: int = Field(description="Values that are used.")
    absurd: list[str] = Field(description="Names of values that are not used, because no tag can measure them.")


class SamplesAcknowledged(Frozen):
    """The answer to one message on the WebSocket for samples. The service has the samples; as with `SamplesReceived`,
    they are judged later."""

    message: int = Field(description="Number of the message on this connection, from 1. 0 is the greeting.")
    samples: int = Field(description="Samples in the payload; 0 when it was rejected.")
    rejected: str | None = Field(description="Why the payload cannot be decoded. To send it again is of no use.")
    detail: str = Field(description="More about the rejection, for people.")
    t_ns: int = Field(description="UTC, ns: when the service took the message.")
    started_ns: int = Field(description="UTC, ns: when this service started. It changes with a restart.")
    tag: str = Field(description="The tag whose samples these are.")
    state: str | None = Field(
        description="Tracking state of the tag, at most a second old; null before its first pose."
    )
    hint: str = Field(description="What a person can do about the state; empty when there is nothing to do.")
    hint_phrase: Phrase | None = Field(default=None, description="The hint by its code; null without one.")


class PhoneReadingsReceived(Frozen):
    """What became of a batch of a phone's readings."""

    samples: int = Field(description="IMU samples that are complete with this batch.")
    unpaired: int = Field(description="Gyroscope readings that were given up: no acceleration at their time.")
    damaged: int = Field(description="Readings that make no sense.")
    duplicate: bool = Field(description="This message of this recording came before; nothing of it was used.")
    waiting: int = Field(description="Messages of this recording that wait for one that was sent before them.")


class TagList(Frozen):
    """Every tag that has sent data or is configured."""

    t_ns: int = Field(description="UTC, ns: the time of the answer.")
    tags: list[TagStatus]


class PendingTag(Frozen):
    """A tag that waits: it sends data, but the service has not admitted it."""

    tag: str
    first_heard_ns: int = Field(description="UTC, ns.")
    last_heard_ns: int
    messages: int


class PendingTagList(Frozen):
    """The pending tags, most recently received first."""

    t_ns: int = Field(description="UTC, ns: the time of the answer.")
    tags: list[PendingTag]


class NewcomerList(Frozen):
    """The same under the former name, until the next version."""

    t_ns: int = Field(description="UTC, ns: the time of the answer.")
    newcomers: list[PendingTag]


class SiteSummary(Frozen):
    """A site that the service serves."""

    site: str = Field(description="Id of the site.")
    name: str = Field(description="Display name; empty: none.")
    georeference: Georeference | None
    anchors: int = Field(description="Number of its anchors.")
    tags: int = Field(description="Number of its tags.")
    online: int = Field(description="Number of its tags that are online.")
    states: dict[TrackingState, int] = Field(description="Number of its tags in each state; without those with none.")
    needs_care: int = Field(description="Number of its tags that need a person.")


class SiteList(Frozen):
    """All sites that the service serves."""

    sites: list[SiteSummary]
    unavailable: list[str] = Field(
        default_factory=list,
        description="Of an API node: the buckets whose sites are missing, because nobody serves them now.",
    )


class AnchorList(Frozen):
    """The anchors of the site."""

    anchors: list[Anchor]


class Connect(Frozen):
    """How a tag connects to this site."""

    endpoints: list[str] = Field(description="Endpoints of the Zenoh router, such as tcp/127.0.0.1:7447.")
    credentials: bool = Field(description="Whether a tag needs the folder that `dropanchor tag add` makes for it.")
    simulate: str = Field(
        description="A command that starts a simulated tag. A client on the service's own machine gets the command "
        "with the full path of the program."
    )
    pages: list[str] = Field(
        default=[],
        description="Addresses of the page for other devices; empty: the service listens on its own machine alone.",
    )
    may_simulate: bool = Field(
        default=False,
        description="Whether the service can start simulated tags itself: if tags need no credentials.",
    )


class QrCodeRequest(Exact):
    """What a QR code is to say."""

    text: str = Field(min_length=1, max_length=1000, description="Such as a link that a phone opens.")


class SimulatedTags(Exact):
    """Simulated tags that the service runs."""

    tags: int = Field(ge=1, le=20, description="How many, `sim-1` to `sim-N`.")


class Health(Frozen):
    """Whether the service is live (it answers) or ready (it can process samples)."""

    status: str
    impaired: list[str] = Field(
        default_factory=list,
        description="Functions that fail while live poses still work, for example a history that cannot be written.",
    )
    impaired_phrases: list[Phrase | None] = Field(
        default_factory=list, description="Each entry of `impaired` by its code; null for one without."
    )


class InvalidPart(Frozen):
    """One error in a request."""

    location: str = Field(description="`body`, `query` or `path`, then the path to the value, joined by dots.")
    detail: str
    detail_phrase: Phrase | None = Field(default=None, description="The detail by its code; null: it has none.")


class Problem(Frozen):
    """Problem details (RFC 9457)."""

    type: str = Field(description="A URI that stays the same for problems of the same kind.")
    title: str
    status: int
    detail: str
    detail_phrase: Phrase | None = Field(default=None, description="The detail by its code; missing: it has none.")
    instance: str = Field(description="The path of the request.")
    errors: list[InvalidPart] | None = Field(default=None, description="The errors in the request, one per location.")
    reasons: list[str] | None = Field(default=None, description="Why the service is not ready.")
    network: str | None = Field(
        default=None, description="The network of receivers that an administrator can allow, so that the request works."
    )
