"""Several applications in one process."""

from fastapi.routing import APIRoute

from dropanchor_schemas.site import Site
from support.api import ask, make_api_bench


def test_applications_of_one_process_share_their_routes_and_nothing_else() -> None:
    first, second = (make_api_bench(Site(id=name)).app() for name in ("a", "b"))
    own, of_other = ({id(route) for route in app.routes if isinstance(route, APIRoute)} for app in (first, second))
    assert len(own - of_other) < 5  # those of health and metrics
    assert [ask(app, "GET", "/api/v1/site").json()["id"] for app in (first, second)] == ["a", "b"]
