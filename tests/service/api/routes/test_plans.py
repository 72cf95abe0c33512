"""Floor plans and their images over REST."""

from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from dropanchor_schemas.site import Georeference, Site
from dropanchor_service.api.http.permissions import Need, need_of
from dropanchor_service.api.routes.plan_images import MAX_UPLOAD_BYTES
from dropanchor_service.api.routes.stream import Changes
from dropanchor_service.plans.reading.messages import Description, ReadPlan
from dropanchor_service.plans.store import PlanStore
from support.api import ask, kind_of, make_api_bench
from support.plan_files import geotiff_file, image_file, svg_file

PLACEMENT = {"x": 1.0, "y": 2.0, "rotation_rad": 0.5, "m_per_px": 0.1}


def app_with(store: PlanStore | None = None, site: Site | None = None) -> FastAPI:
    return make_api_bench(site).app(plans=store or PlanStore(None))


def upload(app: FastAPI, content: bytes, media_type: str = "image/png", **query: Any) -> httpx.Response:
    headers = {"content-type": media_type}
    return ask(app, "POST", "/api/v1/plan-images", content=content, headers=headers, params=query)


def plan(image: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {"id": "hall", "name": "Hall", "image": image, "placement": PLACEMENT} | changes


def test_an_image_is_uploaded_used_by_a_plan_and_served_as_what_it_is(tmp_path: Path) -> None:
    app = app_with(PlanStore(tmp_path))
    uploaded = upload(app, image_file(40, 20))
    assert uploaded.status_code == 201
    image = uploaded.json()["image"]
    assert (image["media_type"], image["width_px"], image["height_px"]) == ("image/png", 40, 20)
    made = ask(app, "PUT", "/api/v1/plans/hall", json=plan(image))
    assert made.json()["placement"] == PLACEMENT
    served = ask(app_with(PlanStore(tmp_path)), "GET", f"/api/v1/plan-images/{image['id']}")
    assert served.headers["content-type"] == "image/png"
    assert served.headers["etag"] == f'"{image["id"]}"'
    assert served.content.startswith(b"\x89PNG")


def test_an_svg_that_an_earlier_version_has_stored_is_served_with_a_policy_that_forbids_scripts() -> None:
    store = PlanStore(None)
    image = store.add_image(ReadPlan(Description(media_type="image/svg+xml"), svg_file()))
    served = ask(app_with(store), "GET", f"/api/v1/plan-images/{image.id}")
    assert served.headers["content-type"] == "image/svg+xml"
    policy = served.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "sandbox" in policy
    assert "script" not in policy
    assert served.headers["x-content-type-options"] == "nosniff"


def test_a_plan_is_made_changed_and_deleted_with_etags() -> None:
    app = app_with()
    image = upload(app, image_file()).json()["image"]
    assert kind_of(ask(app, "GET", "/api/v1/plans/hall")) == "unknown-plan"

    def put(headers: dict[str, str], **changes: Any) -> httpx.Response:
        return ask(app, "PUT", "/api/v1/plans/hall", json=plan(image, **changes), headers=headers)

    made = put({"if-none-match": "*"})
    assert kind_of(put({"if-none-match": "*"})) == "changed-meanwhile"
    seen = ask(app, "GET", "/api/v1/plans/hall")
    assert (seen.headers["etag"], seen.json()) == (made.headers["etag"], made.json())
    assert put({"if-match": made.headers["etag"]}, opacity=0.2).status_code == 200
    assert kind_of(put({"if-match": made.headers["etag"]}, opacity=0.3)) == "changed-meanwhile"
    assert [one["opacity"] for one in ask(app, "GET", "/api/v1/plans").json()["plans"]] == [0.2]
    stale = {"if-match": made.headers["etag"]}
    assert kind_of(ask(app, "DELETE", "/api/v1/plans/hall", headers=stale)) == "changed-meanwhile"
    assert ask(app, "DELETE", "/api/v1/plans/hall").status_code == 204
    assert kind_of(ask(app, "DELETE", "/api/v1/plans/hall")) == "unknown-plan"
    assert put({"if-none-match": "*"}).status_code == 200  # the image is still there, so a deletion can be undone


def test_a_plan_that_cannot_be_is_refused() -> None:
    app = app_with()
    image = upload(app, image_file()).json()["image"]
    refused = {
        "image-not-uploaded": plan(image | {"id": "0" * 32}),
        "id-differs": plan(image, id="roof"),
        "invalid-request": plan(image, floor={"name": "1", "bottom_m": 3.0, "top_m": 3.0}),
    }
    for kind, body in refused.items():
        assert kind_of(ask(app, "PUT", "/api/v1/plans/hall", json=body)) == kind
    assert kind_of(ask(app, "GET", f"/api/v1/plan-images/{'0' * 32}")) == "unknown-plan-image"


def test_a_bad_file_is_a_problem_with_a_sentence() -> None:
    app = app_with()
    refused = upload(app, svg_file('<use href="other.svg#a"/>'), "image/svg+xml")
    assert kind_of(refused) == "plan-image-refused"
    assert "other.svg" in refused.json()["detail"]
    assert kind_of(upload(app, image_file(10_000, 10_000, mode="1"))) == "plan-image-refused"
    assert kind_of(upload(app, b"\0" * (MAX_UPLOAD_BYTES + 1))) == "body-too-large"
    assert kind_of(upload(app, image_file(), page=0)) == "invalid-request"
    assert kind_of(ask(app, "PUT", "/api/v1/plans/hall", content=b"\0" * 2**21)) == "body-too-large"


def test_a_geotiff_comes_with_its_placement_on_a_georeferenced_site() -> None:
    content = geotiff_file(400, 200, (391_400.0, 5_818_000.0), 0.1)
    placed = upload(app_with(site=Site(georeference=Georeference(lat=52.5, lon=13.4))), content, "image/tiff").json()
    assert placed["placement"]["m_per_px"] == pytest.approx(0.1, rel=1e-3)
    assert placed["note"] == ""
    unplaced = upload(app_with(), content, "image/tiff").json()
    assert unplaced["placement"] is None
    assert "no georeference" in unplaced["note"]


def test_a_change_of_a_plan_is_in_the_stream() -> None:
    bench, store = make_api_bench(), PlanStore(None)
    app = bench.app(plans=store)
    changes = Changes(bench.answers, lambda: (bench.answers.site.version, store.version), [])
    image = upload(app, image_file()).json()["image"]
    assert changes.settings() is None
    ask(app, "PUT", "/api/v1/plans/hall", json=plan(image))
    assert changes.settings() is not None
    assert changes.settings() is None


def test_a_writer_makes_plans_and_an_administrator_deletes_them() -> None:
    assert need_of("POST", "/api/v1/plan-images") is Need.WRITE
    assert need_of("PUT", "/api/v1/plans/hall") is Need.WRITE
    assert need_of("DELETE", "/api/v1/plans/hall") is Need.ADMIN
