"""Newline-delimited JSON on standard input: any script can be a tag."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any, BinaryIO, TextIO

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.times import EXPECTED, ns_of_iso
from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.health import HealthValues
from dropanchor_tag_client.options import (
    add_calibration_option,
    add_connection_options,
    add_spool_options,
    is_received,
    opened_client,
)

_MAX_LINE_BYTES = 1_000_000


class BadLineError(ValueError):
    """The line is not a sample and not a message of samples."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tag", help="id of the tag (default: the one of --credentials)")
    parser.add_argument(
        "--clock", choices=["utc", "boot"], default="utc", help="what t_ns counts from (default: %(default)s)"
    )
    add_connection_options(parser)
    add_spool_options(parser)
    add_calibration_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Raises ConnectError, ValueError. Returns 1 when lines were left out, or nobody receives them."""
    if arguments.tag is None:
        raise ValueError("whose samples are these? --tag says so, or --credentials")
    with opened_client(arguments, arguments.tag, clock=arguments.clock) as client:
        bad = publish_lines(client, sys.stdin.buffer, sys.stderr, clock=arguments.clock)
        received = is_received(client)
    refused = sum(client.refused.values())
    sys.stderr.write(f"{client.sent.samples} samples sent, {bad} bad lines, {refused} samples left out\n")
    return 1 if bad or refused or not received else 0


def publish_lines(client: TagClient, lines: BinaryIO, errors: TextIO, *, clock: str = "utc") -> int:
    """Publishes every line; what is wrong with a line goes to `errors`. Returns the number of bad lines."""
    bad = 0
    for number, line in enumerate(_lines(lines), start=1):
        if line.isspace() and len(line) < _MAX_LINE_BYTES:
            continue
        try:
            samples = [(kind, checked(kind, sample)) for kind, sample in samples_of(line, clock)]
            for _, fields in samples:
                _require_utc(client, fields)
            for kind, fields in samples:
                _publish(client, kind, fields)
        except ValueError as error:
            bad += 1
            errors.write(f"line {number}: {error}\n")
    return bad


def imu_of(line: bytes) -> list[ImuSample]:
    """Return the IMU samples of a line, at the time now where they have none. Raises BadLineError."""
    found = []
    for kind, sample in samples_of(line):
        if kind == "imu":
            given = checked(kind, sample)
            found.append(ImuSample(given.get("t_ns", time.time_ns()), given["acc"], given["gyro"], given.get("mag")))
    return found


def _lines(lines: BinaryIO) -> Iterable[bytes]:
    """Lines, of which none is read beyond a limit: the rest of a longer one counts with it."""
    while line := lines.readline(_MAX_LINE_BYTES):
        tail = line
        while len(tail) == _MAX_LINE_BYTES and not tail.endswith(b"\n"):
            tail = lines.readline(_MAX_LINE_BYTES)
        yield line


def samples_of(line: bytes, clock: str = "utc") -> list[tuple[str, dict[str, Any]]]:
    """The samples of a line, each with its kind: a samples message, or one sample object. Raises BadLineError."""
    if len(line) >= _MAX_LINE_BYTES:
        raise BadLineError(f"the line is longer than {_MAX_LINE_BYTES} bytes")
    try:
        value = json.loads(line, parse_constant=_no_constant)
    except RecursionError:
        raise BadLineError("the JSON is nested too deeply") from None
    except ValueError as error:
        raise BadLineError(f"not JSON: {error}") from None
    if not isinstance(value, dict):
        raise BadLineError("a JSON object was expected")
    if value.keys() & {*_KINDS, "version", "clock"}:
        return _message(value, clock)
    for kind in KINDS:
        if kind.value in value:
            return [(kind.name, value)]
    if value.keys() & _HEALTH:
        return [("health", value)]
    raise BadLineError(f"none of {', '.join([*(kind.value for kind in KINDS), *_KINDS])} is there")


_KINDS = {kind.name: kind for kind in KINDS}
_HEALTH = sorted(HealthValues.__annotations__)


def fields_of(kind: str) -> tuple[list[str], list[str]]:
    """Return the fields that a sample of this kind must have, and those that it may have. The kind may be "health"."""
    if kind == "health":
        return [], _HEALTH
    made = _KINDS[kind].sample
    optional = [name for name in made._fields if name in ("t_ns", *made._field_defaults)]
    return [name for name in made._fields if name not in optional], optional


def _message(value: dict[str, Any], clock: str) -> list[tuple[str, dict[str, Any]]]:
    unknown = value.keys() - {*_KINDS, "version", "clock", "sequence", "boot_id"}
    if unknown:
        raise BadLineError(f"a samples message has no field {min(unknown)!r}")
    if value.get("version", 1) != 1:
        raise BadLineError(f"version {value['version']!r} is not known, 1 is")
    if value.get("clock", clock) != clock:
        raise BadLineError(f"the clock is {value['clock']!r}; this program was started for {clock!r}")
    samples = []
    for kind in _KINDS.keys() & value.keys():
        if not isinstance(value[kind], list) or not all(isinstance(sample, dict) for sample in value[kind]):
            raise BadLineError(f"{kind}: a list of objects was expected")
        samples += [(kind, sample) for sample in value[kind]]
    return samples


def publisher_of(kind: str, sample: dict[str, Any]) -> Callable[[TagClient], None]:
    """What publishes the sample, after all of it has been checked. Both raise BadLineError."""
    given = checked(kind, sample)

    def publish(client: TagClient) -> None:
        _require_utc(client, given)
        _publish(client, kind, given)

    return publish


def _require_utc(client: TagClient, fields: dict[str, Any]) -> None:
    wrong = client.why_not_utc(fields["t_ns"]) if "t_ns" in fields else None
    if wrong is not None:
        raise BadLineError(wrong)


def _publish(client: TagClient, kind: str, fields: dict[str, Any]) -> None:
    getattr(client, f"publish_{kind}")(**fields)


def checked(kind: str, sample: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a sample as `publish_…` takes them. Raises BadLineError."""
    needed, optional = fields_of(kind)
    known = {*needed, *optional}
    if "t" in sample and "t_ns" in known:
        sample = _with_t_ns(sample)
    for name in needed:
        if name not in sample:
            raise BadLineError(f"{kind}: {name} is missing")
    for name in sample.keys() - known:
        raise BadLineError(f"{kind}: there is no field {name!r}; known are {', '.join(sorted(known))}")
    return {name: _checked(name, value) for name, value in sample.items() if value is not None or name in needed}


def _with_t_ns(sample: dict[str, Any]) -> dict[str, Any]:
    """Return a sample whose field `t`, ISO 8601, has become its `t_ns`. Raises BadLineError."""
    if "t_ns" in sample:
        raise BadLineError("there are both t and t_ns; one time was expected")
    rest = {name: value for name, value in sample.items() if name != "t"}
    return rest | {"t_ns": _iso("t", sample["t"])}


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadLineError(f"{name} is {value!r}, a number was expected")
    try:
        return float(value)
    except OverflowError:
        raise BadLineError(f"{name} is too large a number") from None


def _vector(name: str, value: Any) -> list[float]:
    if not isinstance(value, list) or len(value) != 3:
        raise BadLineError(f"{name} is {value!r}, a list of three numbers was expected")
    return [_number(name, part) for part in value]


def _anchor(name: str, value: Any) -> int | str:
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise BadLineError(f"{name} is {value!r}, a number or a text was expected")
    return value


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise BadLineError(f"{name} is {value!r}, a text was expected")
    return value


def _iso(name: str, value: Any) -> int:
    try:
        return ns_of_iso(value)
    except (ValueError, AttributeError):
        raise BadLineError(f"{name} is {value!r}, {EXPECTED}") from None


def _time(name: str, value: Any) -> int:
    if isinstance(value, str):
        return _iso(name, value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise BadLineError(f"{name} is {value!r}, an integer was expected")
    return value


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "acc": _vector,
    "gyro": _vector,
    "mag": _vector,
    "anchor": _anchor,
    "t_ns": _time,
    "firmware": _text,
}


def _checked(name: str, value: Any) -> Any:
    return _CHECKS[name](name, value) if name in _CHECKS else _number(name, value)


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")
