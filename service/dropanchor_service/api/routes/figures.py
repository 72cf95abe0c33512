"""The route for the figures of tags over a period: distance, speed and time in zones, as JSON or CSV."""

from collections import defaultdict
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import Query, Request
from pydantic import AfterValidator, Field
from starlette.responses import Response

from dropanchor_schemas.figures import Figures
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.many_tracks import NO_FIGURES, figures_of
from dropanchor_service.api.formats.tables import figures_csv
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import TEXT
from dropanchor_service.api.routes.events import reading
from dropanchor_service.api.routes.parameters import COMMA, Ids, example_response, ids_of, json_response
from dropanchor_service.api.routes.period import TagsInPeriod, history_of, limits_of, reading_history, selected_tags
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.events.stays import TimeInZone, times_in_zones
from dropanchor_service.history.overview import Overview
from dropanchor_service.history.summaries import GAP_NS

_DESCRIPTION = """\
The distance and the speeds of each tag over a period, as with its track, and how long it was in which zone. A tag is in
a zone from its entry to its exit, with the certainty of an event, whether or not the zone makes events of them, with
the shape that it had then. A tag that was not seen for a while counts if it was inside before and after; one that
has not left counts until 10 s after its last stored pose. Deleting a tag or a zone ends the stay. Stays are kept as
long as events."""

_EXAMPLE = {
    "from_ns": 1_799_996_400_000_000_000,
    "to_ns": 1_800_000_000_000_000_000,
    "zones": [{"zone": "dock", "name": "Loading dock"}],
    "tags": [
        {
            "tag": "tag-1",
            "poses": 2210,
            "tracked_s": 3480.2,
            "distance_m": 1930.5,
            "mean_speed_mps": 0.5547,
            "max_speed_mps": 2.31,
            "zones": [{"zone": "dock", "inside_s": 912.4, "stays": 3}],
        }
    ],
}


class FiguresQuery(TagsInPeriod):
    """The tags, the zones, the period and the format."""

    zones: Annotated[list[Ids], AfterValidator(ids_of)] = Field(
        default=[], description=f"Return only the time in these zones. {COMMA} The default is all."
    )
    format: Literal["json", "csv"] = Field(
        default="json", description="The format. CSV has one line for each tag, with a column for each zone."
    )


def _offers() -> dict[int | str, dict[str, Any]]:
    offers = example_response(_EXAMPLE)
    offers[200]["content"]["text/csv"] = TEXT
    return offers


router = Router(tags=["poses"])


@router.get(
    "/figures",
    summary="Get distance, speed and time in zones of tags",
    description=_DESCRIPTION,
    response_model=Figures,
    responses=_offers()
    | problems(Kind.NO_HISTORY, Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE, Kind.EVENTS_UNREADABLE),
)
def get_figures(query: Annotated[FiguresQuery, Query()], request: Request) -> Response:
    parts = parts_of(request)
    found = _figures(parts.answers, parts.events, query)
    if query.format == "json":
        return json_response(found)
    headers = {"cache-control": "no-store", "content-disposition": 'attachment; filename="figures.csv"'}
    return Response(figures_csv(found), media_type="text/csv", headers=headers)


def _figures(answers: Answers, events: EventParts, query: FiguresQuery) -> dict[str, Any]:
    """Return the `Figures`. Raises ProblemError."""
    from_ns, to_ns = limits_of(query, answers.now_ns())
    tracks = history_of(answers)
    with reading_history():
        overview = tracks.reader.overview(selected_tags(answers, tracks, query), from_ns, to_ns, 2)
    with reading():
        times = times_in_zones(events.store.database, from_ns, to_ns, _last_known_ns(overview))
    each = {overview.names[int(row["tag"])]: figures_of(row) for row in overview.figures}
    in_zones = _by_tag(times, query.zones)
    names = query.of_names(answers, sorted(each.keys() | in_zones.keys()))
    used = {time["zone"] for name in names for time in in_zones[name]}
    return {
        "from_ns": from_ns,
        "to_ns": to_ns,
        "zones": [{"zone": zone, "name": _name_of(events, zone)} for zone in sorted(used)],
        "tags": [{"tag": name, **each.get(name, NO_FIGURES), "zones": in_zones[name]} for name in names],
    }


def _last_known_ns(overview: Overview) -> dict[str, int]:
    """Return until when the place of each tag is known."""
    tags, last_ns = overview.figures["tag"].tolist(), overview.figures["last"]["t_ns"].tolist()
    return {overview.names[tag]: t_ns + GAP_NS for tag, t_ns in zip(tags, last_ns, strict=True)}


def _by_tag(times: Mapping[tuple[str, str], TimeInZone], zones: list[str]) -> dict[str, list[dict[str, Any]]]:
    """Return the `TimeInZone` of each tag in these zones, or in all."""
    of_tags = defaultdict[str, list[dict[str, Any]]](list)
    for (tag, zone), time in sorted(times.items()):
        if not zones or zone in zones:
            of_tags[tag].append({"zone": zone, "inside_s": round(time.inside_ns * 1e-9, 3), "stays": time.stays})
    return of_tags


def _name_of(events: EventParts, zone: str) -> str | None:
    known = events.items.zones.all.get(zone)
    return None if known is None else known.name
