"""The routes for floor plans."""

from fastapi import Request

from dropanchor_schemas.plans import Plan, PlanList
from dropanchor_schemas.sentences import say
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import plan_examples as examples
from dropanchor_service.api.routes.item_routes import Resource, add_item_routes
from dropanchor_service.api.routes.parameters import NO_QUERY
from dropanchor_service.api.routes.site_of_request import parts_of


def _plans() -> Resource[Plan]:
    def check_image(plan: Plan, request: Request) -> None:
        if parts_of(request).plans.image(plan.image.id) != plan.image:
            detail = say(
                "plan_upload", "Upload the image with POST /api/v1/plan-images, and put `image` of the answer here."
            )
            raise ProblemError(Kind.IMAGE_NOT_UPLOADED, detail)

    return Resource(
        lambda request: parts_of(request).plans,
        path="plans",
        name="plan",
        list_summary="List the floor plans",
        model=Plan,
        list_model=PlanList,
        example=examples.PLAN,
        unknown=Kind.UNKNOWN_PLAN,
        put_description="Upload its image first. An event `settings` in the stream of poses tells every page.",
        delete_description="The service keeps its image for a while, so that the same plan can be put again.",
        check=check_image,
        refusals=(Kind.IMAGE_NOT_UPLOADED,),
    )


router = Router(tags=["plans"], dependencies=[NO_QUERY])
add_item_routes(router, _plans())
