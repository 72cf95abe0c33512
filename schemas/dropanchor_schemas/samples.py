"""The JSON payload of samples: one object that any program can send."""

import json
import math
from collections.abc import Sequence
from operator import attrgetter
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, create_model

from dropanchor_schemas.keys import checked_id
from dropanchor_schemas.kinds import IMU, KINDS, SCALARS, Frame, ImuSample, Kind, ScalarKind
from dropanchor_schemas.wire import MAX_PAYLOAD_BYTES, MAX_T_NS, VERSION, Reason, Rejection, anchor_number

TimeNs = Annotated[int, Field(ge=0, lt=MAX_T_NS, description="Time of measurement, ns, on the clock of the message.")]
AnchorId = Annotated[
    Annotated[int, Field(ge=0, lt=2**32)]
    | Annotated[str, Field(min_length=1, max_length=64), AfterValidator(checked_id)],
    Field(description='Anchor id: a number or a text. "7" and 7 name the same anchor.'),
]
Vector = tuple[float, float, float]


class _Message(BaseModel):
    """Base class in strict mode: a string or a boolean in place of a number is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Imu(_Message):
    """One IMU sample; body frame x forward, y left, z up."""

    t_ns: TimeNs
    acc: Vector = Field(description="Specific force, m/s² (at rest, level: 0, 0, +9.81).")
    gyro: Vector = Field(description="Angular rate, rad/s.")
    mag: Vector | None = Field(default=None, description="Magnetic field, µT; omit it without a magnetometer.")


def _model_of(kind: ScalarKind) -> type[_Message]:
    fields: dict[str, Any] = {"t_ns": TimeNs}
    if kind.has_anchor:
        fields["anchor"] = AnchorId
    fields[kind.value] = Annotated[float, Field(description=kind.meaning)]
    fields[kind.second] = (Annotated[float | None, Field(description=kind.second_meaning)], None)
    return create_model(kind.name.capitalize(), __base__=_Message, __doc__=kind.description, **fields)


class _SamplesMessage(_Message):
    """A batch of raw samples of one tag."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"range": [{"t_ns": 1760000000000000000, "anchor": "1", "range_m": 12.34}]},
                {
                    "version": 1,
                    "clock": "utc",
                    "sequence": 41,
                    "boot_id": 3735928559,
                    "imu": [
                        {
                            "t_ns": 1760000000000000000,
                            "acc": [0.0, 0.0, 9.81],
                            "gyro": [0.0, 0.0, 0.1],
                            "mag": [0.0, 20.0, -44.0],
                        }
                    ],
                    "range": [{"t_ns": 1760000000010000000, "anchor": 1, "range_m": 12.34, "std_m": 0.1}],
                },
            ]
        },
    )

    version: int = Field(default=1, ge=1, le=1, description="Version of this schema; decoders reject others.")
    clock: Literal["utc", "boot"] = Field(
        default="utc", description="`utc`: ns since 1970; `boot`: ns since the tag's start."
    )
    replay: bool = Field(
        default=False,
        description="Whether the samples come from a replayed recording; ages then count from its current time.",
    )
    sequence: int | None = Field(default=None, ge=0, lt=2**32, description="Message counter of the publisher.")
    boot_id: int | None = Field(
        default=None, ge=0, lt=2**32, description="Random number, drawn at each start of the publisher."
    )
    imu: list[Imu] = []


_LISTS: dict[str, Any] = {kind.name: (list[_model_of(kind)], []) for kind in SCALARS}  # type: ignore[misc]
SamplesMessage = create_model("SamplesMessage", __base__=_SamplesMessage, __doc__=_SamplesMessage.__doc__, **_LISTS)


def decode_json(payload: bytes) -> Frame | Rejection:
    """Decode a JSON payload. Return its frame, or a rejection. This checks the form only, not the values."""
    if len(payload) == 0:
        return Rejection(Reason.PAYLOAD_EMPTY, "the payload is empty")
    if len(payload) > MAX_PAYLOAD_BYTES:
        return Rejection(Reason.PAYLOAD_TOO_LARGE, f"{len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}")
    try:
        message = SamplesMessage.model_validate_json(payload)
    except ValidationError as error:
        return unknown_version(payload) or rejection_of(error)
    frame = _frame(message)
    return frame if len(frame) else Rejection(Reason.NO_SAMPLES, "the message holds no samples")


def unknown_version(payload: bytes) -> Rejection | None:
    """Return the rejection of a payload of another version, or None if the version is not the problem."""
    try:
        message = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    version = message.get("version") if isinstance(message, dict) else None
    if not isinstance(version, int) or isinstance(version, bool) or version == VERSION:
        return None
    return Rejection(Reason.VERSION_UNKNOWN, f"version {version}, this decoder knows {VERSION}")


def rejection_of(error: ValidationError) -> Rejection:
    """Return the rejection of a payload that does not match its model."""
    first = error.errors(include_input=False, include_url=False)[0]
    if first["type"] == "json_invalid":
        return Rejection(Reason.JSON_SYNTAX, first["msg"])
    where = ".".join(str(part) for part in first["loc"]) or "the message"
    return Rejection(Reason.JSON_SCHEMA, f"{where}: {first['msg']}")


def _frame(message: _SamplesMessage) -> Frame:
    parsed = [(kind, getattr(message, kind.name)) for kind in KINDS]
    named = [sample.anchor for kind, samples in parsed if kind.has_anchor for sample in samples]
    lists: dict[str, Any] = {kind.field: _samples(kind, samples) for kind, samples in parsed}
    return Frame(
        **lists,
        sequence=message.sequence,
        boot_id=message.boot_id,
        boot_clock=message.clock == "boot",
        replay=message.replay,
        anchor_names={anchor_number(name): name for name in named if isinstance(name, str)},
    )


def _samples(kind: Kind, parsed: Sequence[Any]) -> list[Any]:
    values = map(attrgetter(*kind.sample._fields), parsed)
    if kind is IMU:
        return [ImuSample(*v) for v in values]
    if kind.has_anchor:
        return [kind.sample(t_ns, anchor_number(anchor), *_known(*rest)) for t_ns, anchor, *rest in values]
    return [kind.sample(t_ns, *_known(*rest)) for t_ns, *rest in values]


def _known(value: float, second: float | None) -> tuple[float, float]:
    return value, math.nan if second is None else second
