"""`dropanchor doctor`: run through what can be wrong with a service, or with one tag now or at a time that is past."""

import argparse
import os
import platform
import time
from collections.abc import Iterator, Mapping
from http import HTTPStatus
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from dropanchor_schemas.rejections import REASONS_EXPLAINED, Reason
from dropanchor_schemas.times import ns_of_parameter
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.commands.rest import KEY_VARIABLE, RefusedError, add_rest_options, asked
from dropanchor_service.runtime.kernel_cache import VARIABLE, state_of
from dropanchor_service.runtime.written_by import FILE, later_version, of_later, writer_of
from dropanchor_tag_client.host import VERSION

DESCRIPTION = f"""\
Runs through what can be wrong, and says of each what it found: of a running service whether it is ready, and what is
impaired (disk, folder, keys, threads, clock of the machine); with --tag, whether it is the tag (clock, sensors, radio),
the anchor, the site, the settings (who changed which, and when) or the estimate. With --at it looks at the past, as
the black box has it. With --data-dir it looks at this machine, too: versions, compiled kernels, and which version
wrote the folder. If the service requires an API key, set the environment variable {KEY_VARIABLE}. What a service needs
before its start tells `dropanchor check`.
Exit code: 0 nothing is wrong, 1 something is, 2 no answer.
"""
EPILOG = """\
examples:
  dropanchor doctor
  dropanchor doctor --data-dir /var/lib/dropanchor
  dropanchor doctor --tag forklift-7
  dropanchor doctor --tag forklift-7 --at 2026-01-30T15:00:00Z
"""
EXIT_FOUND = 1
REFUSED = (RefusedError,)
CLOCK_S = 2.0
PAST_S = 330.0  # more than RUN_S of `blackbox/box.py`, for which a service runs a moment of the past again at most
DAY_NS = 86_400_000_000_000
FEW_RANGES = 10  # a share of fewer tells nothing
MOST = 0.5
NORTH_RAD = 0.09
_OF_CLOCKS = {Reason.TIME_OUT_OF_RANGE, Reason.TIME_NOT_UTC, Reason.LATE, Reason.TIME_REPEATED}
_UNSURE = ("ambiguous", "degraded", "lost", "initialising", "relative")


class Finding(NamedTuple):
    """What was found. is_wrong: whether somebody should look."""

    where: str
    sentence: str
    is_wrong: bool = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_rest_options(parser)
    parser.add_argument("--data-dir", metavar="FOLDER", type=Path, help="the data folder of a service on this machine")
    parser.add_argument("--site", metavar="ID", help="the site of the tag (default: the only one)")
    parser.add_argument("--tag", metavar="ID", help="what is wrong with this tag")
    parser.add_argument("--at", metavar="TIME", type=ns_of_parameter, help="at this time, ISO 8601 with a time zone")


def run(arguments: argparse.Namespace) -> int:
    """Print what was found. Return 0 if nothing is wrong, else 1. Raises REFUSED if no service answers."""
    found_wrong = False
    for where, sentence, is_wrong in _findings(arguments):
        print(f"{'LOOK' if is_wrong else 'good'}  {where}: {sentence}", flush=True)
        found_wrong |= is_wrong
    return EXIT_FOUND if found_wrong else 0


def _findings(arguments: argparse.Namespace) -> Iterator[Finding]:
    """Raises RefusedError."""
    if arguments.data_dir is not None:
        yield from _of_machine(arguments.data_dir)
    yield from _of_service(arguments)
    if arguments.tag:
        yield from _of_tag(arguments)


def _of_machine(folder: Path) -> Iterator[Finding]:
    versions = ", ".join(f"{name} {version(name)}" for name in ("numba", "numpy", "eclipse-zenoh"))
    python = f"Python {platform.python_version()}"
    yield Finding("versions", f"dropanchor {VERSION}, {python}, {versions}", is_wrong=False)
    sentence, is_ready = state_of(Path(os.environ[VARIABLE]))
    yield Finding("kernels", sentence, not is_ready)
    if later_version(folder / FILE) is not None:
        yield Finding("folder", of_later(folder, "its file `written_by` says so", folder / FILE))
    elif (writer := writer_of(folder)) is None:
        yield Finding("folder", f"no version has written into {folder} yet")
    else:
        yield Finding("folder", f"version {writer} was the latest to write into {folder}", is_wrong=False)


def _of_service(arguments: argparse.Namespace) -> Iterator[Finding]:
    """Raises RefusedError."""
    try:
        impaired = asked(arguments, "GET", "/health/ready")["impaired"]
        yield Finding("service", "it is ready", is_wrong=False)
    except RefusedError as error:
        if error.status != HTTPStatus.SERVICE_UNAVAILABLE:
            raise
        impaired = []
        yield Finding("service", f"it is not ready: {error}")
    yield from (Finding("service", sentence) for sentence in impaired)


def _of_tag(arguments: argparse.Namespace) -> Iterator[Finding]:
    """Raises RefusedError."""
    site = "" if arguments.site is None else f"/sites/{quote(arguments.site, safe='')}"
    path = f"{site}/tags/{quote(arguments.tag, safe='')}"
    before_ns = time.time_ns()
    now_ns = asked(arguments, "GET", f"{site}/tags?tags={quote(arguments.tag, safe='')}")["t_ns"]
    ahead_s = (now_ns - (before_ns + time.time_ns()) / 2) * 1e-9
    yield Finding(
        "service", f"its clock is {ahead_s:+.1f} s from that of this machine", is_wrong=abs(ahead_s) > CLOCK_S
    )
    status = asked(arguments, "GET", path)
    at_ns = arguments.at or now_ns
    explanation = _explanation(arguments, path, at_ns)
    yield from _of_radio(status, explanation, at_ns, is_now=arguments.at is None)
    yield from _of_samples(status, explanation)
    yield from _of_anchors(explanation)
    yield from _of_north(explanation)
    yield from _of_settings(asked(arguments, "GET", f"{site}/audit?from={at_ns - DAY_NS}&to={at_ns}"), arguments.tag)
    yield from _of_estimate(explanation)


def _explanation(arguments: argparse.Namespace, path: str, at_ns: int) -> Mapping[str, Any]:
    """Return the explanation at a time; without a black box, that of now. Raises RefusedError."""
    try:
        found: Mapping[str, Any] = asked(arguments, "GET", f"{path}/explain?at={at_ns}&last=300", timeout_s=PAST_S)
    except RefusedError as error:
        if arguments.at is not None or error.status not in (HTTPStatus.CONFLICT, HTTPStatus.NOT_FOUND):
            raise
        found = asked(arguments, "GET", f"{path}/explain?last=300")
    return found


def _of_radio(status: Mapping[str, Any], explanation: Mapping[str, Any], at_ns: int, is_now: bool) -> Iterator[Finding]:
    heard_ns = status["last_heard_ns"] if is_now else explanation["pose"]["t_ns"]
    silent_s = (at_ns - (heard_ns or 0)) * 1e-9
    sentence = f"its last sample was {silent_s:.0f} s old" if silent_s < 1e6 else "it has sent nothing"
    yield Finding("tag, radio", sentence, is_wrong=silent_s > 5)
    missing = [one for one in _incidents(explanation) if one["kind"] in ("missing", "restart")]
    yield from (Finding("tag, radio", f"{one['count']} x {one['kind']} at {iso_utc(one['t_ns'])}") for one in missing)


def _of_samples(status: Mapping[str, Any], explanation: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield what is wrong with the clock and the sensors."""
    for one in _incidents(explanation):
        when = iso_utc(one["t_ns"])
        if one["kind"] == "clock_jump":
            yield Finding("tag, clock", f"its clock was set at {when}")
        elif one["kind"] == "rejected":
            where = "tag, clock" if one["reason"] in _OF_CLOCKS else "tag, sensors"
            why = REASONS_EXPLAINED[Reason(one["reason"])].cause
            yield Finding(where, f"{one['count']} x {one['reason']} at {when}: {why}")
    if status["clock_error_s"] is not None:
        yield Finding("tag, clock", f"it is {status['clock_error_s']:+.1f} s from that of the service")
    yield from (Finding("tag", care["hint"]) for care in status["needs_care"])
    if status["hint"]:
        yield Finding("tag", status["hint"])


def _of_anchors(explanation: Mapping[str, Any]) -> Iterator[Finding]:
    if explanation["pose"]["reason"] == "anchor_doubted":
        yield Finding("anchor", "the ranges of the tags contradict its place: it was moved, or measured wrongly")
    ranges: dict[str, list[Mapping[str, Any]]] = {}
    for one in explanation["innovations"]:
        ranges.setdefault(str(one["anchor"]), []).append(one)
    for anchor, of_anchor in ranges.items():
        refused = [one for one in of_anchor if not one["fused"]]
        share = len(refused) / len(of_anchor)
        sentence = f"{anchor}: {len(refused)} of the last {len(of_anchor)} ranges do not fit"
        if refused:
            middle = sorted(one["innovation"] for one in refused)[len(refused) // 2]
            sentence += f", the middle one by {middle:+.2f} m"
        is_wrong = len(of_anchor) >= FEW_RANGES and share > MOST
        hint = ". Longer ranges: something is in the way. Both ways: it was moved" if is_wrong else ""
        yield Finding("anchor", sentence + hint, is_wrong)


def _of_north(explanation: Mapping[str, Any]) -> Iterator[Finding]:
    north, uncertainty = explanation["north"], explanation["uncertainty"]
    if north is not None and abs(north["error_rad"]) > max(NORTH_RAD, 2 * north["std_rad"]):
        yield Finding("site", f"north is off by {north['error_rad']:+.2f} rad where the tag is")
    elif uncertainty is not None:
        yield Finding("site", f"most of the uncertainty comes from its {uncertainty['largest']}", is_wrong=False)


def _of_settings(trail: Mapping[str, Any], tag: str) -> Iterator[Finding]:
    """Yield who changed what of the tag, the anchors and the site in the day before."""
    for entry in trail["entries"]:
        if entry["kind"] in ("anchor", "site") or (entry["kind"], entry["item"]) == ("tag", tag):
            who = " ".join(filter(None, (entry["by"]["source"], entry["by"]["name"])))
            what = ", ".join(_differences(entry["before"] or {}, entry["after"] or {}))
            yield Finding("settings", f"{iso_utc(entry['t_ns'])} {who} changed {entry['kind']} {entry['item']}: {what}")


def _differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[str]:
    for name in {**before, **after}:
        if before.get(name) != after.get(name):
            yield f"{name} {before.get(name)} → {after.get(name)}"


def _of_estimate(explanation: Mapping[str, Any]) -> Iterator[Finding]:
    pose = explanation["pose"]
    sentence = f"{pose['state']} ({pose['reason']})"
    if explanation["hypotheses"]:
        weights = ", ".join(f"{one['weight']:.0%}" for one in explanation["hypotheses"])
        sentence += f", at one of {len(explanation['hypotheses'])} places: {weights}"
    yield Finding("estimate", sentence, is_wrong=pose["state"] in _UNSURE)
    past = explanation.get("past") or {}
    yield from (Finding("cause", cause["text"]) for cause in past.get("causes", ()))
    changes = past.get("states", [])[-5:]
    for one in changes:
        yield Finding("estimate", f"{iso_utc(one['t_ns'])} {one['state']} ({one['reason']})", is_wrong=False)


def _incidents(explanation: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return what happened to its samples; nothing without a black box."""
    found: list[Mapping[str, Any]] = (explanation.get("past") or {}).get("incidents", [])
    return found
