"""`dropanchor status`: show how a running service and its tags do."""

import argparse
import json
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from dropanchor_service.commands.rest import KEY_VARIABLE, RefusedError, add_rest_options, asked

DESCRIPTION = f"""\
Shows whether a running service can do its work and what does not work, and for each site its tags by state, what needs
a person, samples that were refused, tags that wait to be admitted, the tags in each zone, and the last events. If the
service requires an API key, set the environment variable {KEY_VARIABLE}; without one only the health is shown.
Exit code: 0 healthy, 1 not ready or impaired, 2 no answer.
"""
EPILOG = """\
examples:
  dropanchor status
  dropanchor status --url https://yard.example:8080 --ca security/ca.pem
  dropanchor status --site north --json
"""
EXIT_UNHEALTHY = 1
REFUSED = (RefusedError,)
_EVENTS = 5
_OF_SITE = {
    "tags": ("tags", "/tags"),
    "pending_tags": ("tags", "/pending-tags"),
    "zones": ("zones", "/zones"),
    "zone_occupancy": ("zones", "/zone-occupancy"),
    "events": ("events", f"/events?limit={_EVENTS}"),
}
"""What is asked about each site: the name in our answer, the name in that of REST, and the path."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_rest_options(parser)
    parser.add_argument("--site", metavar="ID", help="show this site only (default: all)")
    parser.add_argument("--json", action="store_true", help="print the answers of the service as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Print the status. Return 0 for a healthy service, 1 for another. Raises REFUSED if none answers."""
    found = _found(arguments)
    print(json.dumps(found, indent=2) if arguments.json else "\n".join(_lines(found)))
    return 0 if found["healthy"] else EXIT_UNHEALTHY


def _found(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the answers of the service. Raises RefusedError."""
    not_ready, impaired = _health(arguments)
    found = {"url": arguments.url, "healthy": not (not_ready or impaired), "not_ready": not_ready, "impaired": impaired}
    try:
        sites = asked(arguments, "GET", "/sites")["sites"]
        wanted = [site for site in sites if arguments.site in (None, site["site"])]
        if not wanted and arguments.site is not None:
            raise RefusedError(f"{arguments.url} has no site {arguments.site}, or the key does not allow it")
        return found | {"sites": [{"summary": site, **_of_site(arguments, site["site"])} for site in wanted]}
    except RefusedError as error:
        if error.status == HTTPStatus.UNAUTHORIZED:
            return found | {"sites": None}
        if error.status == HTTPStatus.SERVICE_UNAVAILABLE and not_ready:  # it starts
            return found | {"sites": []}
        raise


def _health(arguments: argparse.Namespace) -> tuple[list[str], list[str]]:
    """Return why the service is not ready, and what else does not work. Raises RefusedError."""
    try:
        return [], asked(arguments, "GET", "/health/ready")["impaired"]
    except RefusedError as error:
        if error.status != HTTPStatus.SERVICE_UNAVAILABLE:
            raise
        return [str(error)], []


def _of_site(arguments: argparse.Namespace, site: str) -> dict[str, Any]:
    prefix = f"/sites/{quote(site, safe='')}"
    return {name: asked(arguments, "GET", prefix + path)[key] for name, (key, path) in _OF_SITE.items()}


def _lines(found: dict[str, Any]) -> Iterator[str]:
    yield f"{found['url']}: {'ready' if not found['not_ready'] else 'not ready'}"
    yield from (f"  {reason}" for reason in found["not_ready"])
    yield from (f"  impaired: {reason}" for reason in found["impaired"])
    if found["sites"] is None:
        yield f"  what the tags do needs an API key: set {KEY_VARIABLE}"
    for site in found["sites"] or ():
        yield from _of_one(site)


def _of_one(site: dict[str, Any]) -> Iterator[str]:
    summary = site["summary"]
    states = "".join(f", {count} {state}" for state, count in summary["states"].items())
    yield f"site {summary['site']}: {summary['tags']} tags, {summary['online']} connected{states}"
    for tag in site["tags"]:
        cares = [care["hint"] for care in tag.get("needs_care", ())]
        refused = [f"{count} {reason} refused" for reason, count in tag.get("rejected", {}).items()]
        if said := [*cares, *([tag["hint"]] if tag.get("hint") else []), *refused]:
            yield f"  tag {tag['tag']}: {'; '.join(said)}"
    yield from (f"  tag {tag['tag']} waits to be admitted" for tag in site["pending_tags"])
    inside = {zone["zone"]: zone["tags"] for zone in site["zone_occupancy"]}
    yield from (f"  zone {zone['id']}: {inside.get(zone['id'], 0)} tags" for zone in site["zones"])
    yield from (
        f"  {event['time']} {event['type'].removeprefix('dropanchor.')} {event.get('subject', '')} "
        f"{event['data'].get('zone', '')}".rstrip()
        for event in site["events"]
    )
