"""The routes for floor plans."""

from typing import Annotated

from fastapi import APIRouter, Body, Depends
from starlette.responses import Response

from dropanchor_schemas.plans import Plan, PlanList
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.etags import Conditions
from dropanchor_service.api.routes import plan_examples as examples
from dropanchor_service.api.routes.items import CHANGE_KINDS, path_id
from dropanchor_service.api.routes.parameters import (
    NO_QUERY,
    example_response,
    json_response,
    resource_response,
    saving,
)
from dropanchor_service.plans.store import ImageMissingError, PlanStore
from dropanchor_service.store.items import FullError

PlanId = Annotated[str, Depends(path_id("plan", "ground-floor"))]


def plans_router(store: PlanStore) -> APIRouter:
    router = APIRouter(tags=["plans"], dependencies=[NO_QUERY])
    _add_read_routes(router, store)
    _add_change_routes(router, store)
    return router


def _add_read_routes(router: APIRouter, store: PlanStore) -> None:
    @router.get(
        "/plans",
        operation_id="list_plans",
        summary="List the floor plans",
        response_model=PlanList,
        responses=example_response({"plans": [examples.PLAN]}) | problems(Kind.INVALID_REQUEST),
    )
    async def list_plans() -> Response:
        return json_response({"plans": [plan.model_dump() for plan in store.all.values()]})

    @router.get(
        "/plans/{plan}",
        operation_id="get_plan",
        summary="Get a floor plan",
        description="The `ETag` of the answer can go into the `If-Match` of a change.",
        response_model=Plan,
        responses=example_response(examples.PLAN) | problems(Kind.UNKNOWN_PLAN, Kind.INVALID_REQUEST),
    )
    async def get_plan(plan: PlanId) -> Response:
        known = store.all.get(plan)
        if known is None:
            raise _unknown(plan)
        return resource_response(known)


def _add_change_routes(router: APIRouter, store: PlanStore) -> None:
    @router.put(
        "/plans/{plan}",
        operation_id="put_plan",
        summary="Create or replace a floor plan",
        description="Upload its image first. An event `settings` in the stream of poses tells every page.",
        response_model=Plan,
        responses=example_response(examples.PLAN)
        | problems(Kind.IMAGE_NOT_UPLOADED, *CHANGE_KINDS, Kind.INVALID_REQUEST),
    )
    def put_plan(plan: PlanId, body: Annotated[Plan, Body(examples=[examples.PLAN])], allows: Conditions) -> Response:
        if body.id != plan:
            raise ProblemError(Kind.ID_DIFFERS, f"The id is {plan!r} in the path and {body.id!r} in the body.")
        with saving():
            try:
                store.put(body, allows)
            except ImageMissingError as error:
                raise ProblemError(
                    Kind.IMAGE_NOT_UPLOADED,
                    "Upload the image with POST /api/v1/plan-images, and put `image` of the answer here.",
                ) from error
            except FullError as error:
                detail = f"There are {len(store.all)} plans already. Delete one first."
                raise ProblemError(Kind.ITEMS_FULL, detail) from error
        return resource_response(body)

    @router.delete(
        "/plans/{plan}",
        operation_id="delete_plan",
        summary="Delete a floor plan",
        description="The service keeps its image for a while, so that the same plan can be put again.",
        status_code=204,
        responses=problems(Kind.UNKNOWN_PLAN, Kind.CHANGED_MEANWHILE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
    )
    def delete_plan(plan: PlanId, allows: Conditions) -> Response:
        with saving():
            try:
                store.remove(plan, allows)
            except KeyError as error:
                raise _unknown(plan) from error
        return Response(status_code=204)


def _unknown(plan: str) -> ProblemError:
    return ProblemError(Kind.UNKNOWN_PLAN, f"There is no floor plan {plan!r}.")
