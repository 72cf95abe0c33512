"""The routes of items that people edit by id, such as zones: list, get, put and delete."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Generic

from fastapi import APIRouter, Body, Depends, Request
from starlette.responses import Response

from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.etags import Conditions
from dropanchor_service.api.routes.items import CHANGE_KINDS, Item, delete, found, item_response, path_id, put
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.store.items import NamedItems


@dataclass(frozen=True)
class Resource(Generic[Item]):
    """Items of one kind, and how the OpenAPI document describes them.

    items_of: returns the items of the site of a request. path: of the list; the ids of the operations follow from it.
    name: of one item, in its path and in sentences. check: raises ProblemError for an item that cannot be saved in the
    site of the request, with one of the kinds in `refusals`.
    """

    items_of: Callable[[Request], NamedItems[Item]]
    path: str
    name: str
    list_summary: str
    model: Any
    list_model: Any
    example: dict[str, Any]
    unknown: Kind
    put_description: str = ""
    delete_description: str = ""
    check: Callable[[Item, Request], None] = lambda _item, _request: None
    refusals: Sequence[Kind] = ()

    @property
    def operation(self) -> str:
        """The name of one item in the ids of the operations."""
        return self.path.replace("-", "_").removesuffix("s")


def add_item_routes(router: APIRouter, resource: Resource[Item]) -> None:
    id_of_path = Depends(path_id(resource.name, resource.example["id"]))
    _add_reading(router, resource, id_of_path)
    _add_put(router, resource, id_of_path)
    _add_delete(router, resource, id_of_path)


def _add_reading(router: APIRouter, resource: Resource[Item], id_of_path: Any) -> None:
    items_of, key = resource.items_of, f"{resource.name}s"

    @router.get(
        f"/{resource.path}",
        operation_id=f"list_{resource.operation}s",
        summary=resource.list_summary,
        response_model=resource.list_model,
        responses=example_response({key: [resource.example]}) | problems(Kind.INVALID_REQUEST),
    )
    async def list_items(request: Request) -> Response:
        return json_response({key: [item.model_dump() for item in items_of(request).all.values()]})

    @router.get(
        f"/{resource.path}/{{{resource.name}}}",
        operation_id=f"get_{resource.operation}",
        summary=f"Get a {resource.name}",
        response_model=resource.model,
        responses=example_response(resource.example) | problems(resource.unknown, Kind.INVALID_REQUEST),
    )
    async def get_item(item_id: Annotated[str, id_of_path], request: Request) -> Response:
        return item_response(found(items_of(request), item_id, resource.unknown))


def _add_put(router: APIRouter, resource: Resource[Item], id_of_path: Any) -> None:
    @router.put(
        f"/{resource.path}/{{{resource.name}}}",
        operation_id=f"put_{resource.operation}",
        summary=f"Create or replace a {resource.name}",
        description=resource.put_description,
        response_model=resource.model,
        responses=example_response(resource.example)
        | problems(*resource.refusals, *CHANGE_KINDS, Kind.INVALID_REQUEST),
    )
    def put_item(
        item_id: Annotated[str, id_of_path],
        body: Annotated[resource.model, Body(examples=[resource.example])],  # type: ignore[name-defined]
        allows: Conditions,
        request: Request,
    ) -> Response:
        resource.check(body, request)
        put(resource.items_of(request), item_id, body.id, body, allows)
        return item_response(body)


def _add_delete(router: APIRouter, resource: Resource[Item], id_of_path: Any) -> None:
    @router.delete(
        f"/{resource.path}/{{{resource.name}}}",
        operation_id=f"delete_{resource.operation}",
        summary=f"Delete a {resource.name}",
        description=resource.delete_description,
        status_code=204,
        responses=problems(resource.unknown, Kind.CHANGED_MEANWHILE, Kind.NOT_SAVED, Kind.INVALID_REQUEST),
    )
    def delete_item(item_id: Annotated[str, id_of_path], allows: Conditions, request: Request) -> Response:
        return delete(resource.items_of(request), item_id, allows, resource.unknown)
