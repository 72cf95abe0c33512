"""The routes for the trail of changes: pages of it, and a file with all of a period."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any, Literal, get_args

from fastapi import Query, Request
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from starlette.responses import Response, StreamingResponse

from dropanchor_schemas.audit import SECRET_KINDS, AuditKind, AuditList
from dropanchor_schemas.site import Id
from dropanchor_service.api.formats.tables import changes_csv
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import LINES, lines_response
from dropanchor_service.api.routes.events import reading
from dropanchor_service.api.routes.parameters import TimeNs, example_response, json_response, words_of
from dropanchor_service.api.routes.period import require_order
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.events.trail import ChangeTrail, Wanted
from dropanchor_service.security.identity import Scope

PAGE = 1000
_KINDS = get_args(AuditKind)
_DESCRIPTION = """\
Who changed the site, anchors, tags, zones, rules, plans, destinations, keys or share links, when, and what it was
before; the newest first. An entry is written before its change is acknowledged, and kept as long as events. Those of
keys and share links are for administrators. What the command `dropanchor` changes on the machine itself is not in it.

To undo a change, put `before` with the route of what was changed, or delete it if `before` is null."""
_EXAMPLE = {
    "entries": [
        {
            "number": 17,
            "t_ns": 1_800_000_000_000_000_000,
            "by": {"source": "key", "name": "anna"},
            "kind": "anchor",
            "item": "1",
            "before": {"id": "1", "x": 0.0, "y": 0.0, "z": 2.5},
            "after": {"id": "1", "x": 50.0, "y": 0.0, "z": 2.5},
            "confirmed": True,
        }
    ],
    "next": None,
}


class AuditFilter(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    from_ns: TimeNs = Field(
        default=0, alias="from", description="Only changes from this time on, UTC in ns, or ISO 8601 with a time zone."
    )
    to_ns: TimeNs = Field(
        default=2**62 - 1, alias="to", description="Only changes up to this time. The default is now."
    )
    kind: Annotated[list[AuditKind], BeforeValidator(words_of)] = Field(
        default=[],
        description="Only changes of this kind. Separate several with commas, or repeat the parameter.",
        examples=[["anchor,tag"]],
    )
    item: Id | None = Field(default=None, description="Only changes of what has this id.")

    def wanted(self, request: Request) -> Wanted:
        """Return what the client may read of it. Raises ProblemError."""
        require_order(self.from_ns, self.to_ns)
        scope = getattr(request.state, "scope", Scope.ADMIN)  # without authentication everybody may do all
        kinds = [kind for kind in self.kind or _KINDS if scope is Scope.ADMIN or kind not in SECRET_KINDS]
        return Wanted(self.from_ns, self.to_ns, kinds, self.item)


class AuditQuery(AuditFilter):
    before: int = Field(
        default=2**62, ge=0, le=2**62, description="Only changes with a lower number: `next` of a page."
    )
    limit: int = Field(default=100, ge=1, le=PAGE, description="How many changes to return.")


class AuditFileQuery(AuditFilter):
    format: Literal["csv", "jsonl"] = Field(default="jsonl", description="JSON lines, or CSV with JSON in two columns.")


router = Router(tags=["site"])


@router.get(
    "/audit",
    summary="List who changed which setting, when, and what it was before",
    description=_DESCRIPTION,
    response_model=AuditList,
    responses=example_response(_EXAMPLE) | problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE),
)
def list_changes(query: Annotated[AuditQuery, Query()], request: Request) -> Response:
    wanted = replace(query.wanted(request), before=query.before)
    with reading():
        found = parts_of(request).events.trail.entries(wanted, query.limit + 1)
    shown = found[: query.limit]
    return json_response({"entries": shown, "next": shown[-1]["number"] if len(found) > len(shown) else None})


@router.get(
    "/audit/file",
    summary="Download who changed which setting, as CSV or JSON lines",
    response_class=StreamingResponse,
    responses=problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE) | LINES,
)
def get_changes_file(query: Annotated[AuditFileQuery, Query()], request: Request) -> Response:
    pages = _pages(parts_of(request).events.trail, query.wanted(request))
    return lines_response("changes", pages, changes_csv if query.format == "csv" else None)


def _pages(trail: ChangeTrail, wanted: Wanted) -> Iterator[list[dict[str, Any]]]:
    """Yield all entries, page by page. Raises ProblemError."""
    while True:
        with reading():
            found = trail.entries(wanted, PAGE)
        yield found
        if len(found) < PAGE:
            return
        wanted = replace(wanted, before=found[-1]["number"])
