"""What the routes of edited items share: ETags, and problems for items that are unknown, changed or too many."""

from collections.abc import Callable
from typing import Annotated, TypeVar

from fastapi import Depends, Path
from pydantic import BaseModel
from starlette.responses import Response

from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.etags import etag_of
from dropanchor_service.api.routes.parameters import id_of, json_response, saving
from dropanchor_service.store.items import FullError, NamedItems
from dropanchor_service.store.preconditions import Precondition

Item = TypeVar("Item", bound=BaseModel)

CHANGE_KINDS = (Kind.ID_DIFFERS, Kind.ITEMS_FULL, Kind.CHANGED_MEANWHILE, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED)


def path_id(what: str, example: str) -> Callable[..., str]:
    """Return the dependency that reads the id of an item from the path."""

    def read(
        name: Annotated[
            str,
            Path(
                alias=what,
                description=f"The {what}'s id, percent-escaped.",
                examples=[example],
                json_schema_extra=ID_SCHEMA,
            ),
        ],
    ) -> str:
        return id_of(name)

    return read


DestinationId = Annotated[str, Depends(path_id("destination", "mes"))]


def item_response(item: BaseModel, answer: BaseModel | None = None) -> Response:
    """Return the item, or the answer that stands for it, with the ETag of the item."""
    response = json_response((answer or item).model_dump(mode="json"))
    response.headers["etag"] = etag_of(item)
    return response


def found(items: NamedItems[Item], name: str, unknown: Kind) -> Item:
    """Return the item. Raises ProblemError when there is none."""
    item = items.all.get(name)
    if item is None:
        raise _unknown(name, unknown)
    return item


def put(items: NamedItems[Item], name: str, body_id: str, item: Item, allows: Precondition) -> None:
    """Save the item. Raises ProblemError."""
    if body_id != name:
        raise ProblemError(
            Kind.ID_DIFFERS,
            say(
                "id_differs",
                "The id is {path} in the path and {body} in the body.",
                path=repr(name),
                body=repr(body_id),
            ),
        )
    with saving():
        try:
            items.put(name, item, allows)
        except FullError as error:
            raise ProblemError(
                Kind.ITEMS_FULL, say("items_full", "There are {n} already. Delete one first.", n=len(items.all))
            ) from error


def delete(items: NamedItems[Item], name: str, allows: Precondition, unknown: Kind) -> Response:
    """Delete the item. Raises ProblemError."""
    with saving():
        try:
            items.remove(name, allows)
        except KeyError as error:
            raise _unknown(name, unknown) from error
    return Response(status_code=204)


def _unknown(name: str, kind: Kind) -> ProblemError:
    return ProblemError(kind, say("item_unknown", "There is none with the id {id}.", id=repr(name)))
