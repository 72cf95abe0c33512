"""Tags, settings, the site and its anchors over REST."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.answers import NewcomerList, PendingTagList, TagList, TagStatus
from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_schemas.wire import Reason
from support.api import ask, kind_of, make_api_bench


def test_a_tag_shows_its_counts_of_messages_samples_and_rejections() -> None:
    bench = make_api_bench()
    tags = bench.answers.tags
    rows = np.array([tags.register("a").row])
    tags.rows.count_messages(rows, 5_000)
    tags.rows.count_samples("range", np.repeat(rows, 3))
    tags.rows.count_rejected(Reason.LATE, rows)
    tags.presence.set_token("a", True)
    tag = TagStatus.model_validate(ask(bench.app(), "GET", "/api/v1/tags/a").json())
    assert (tag.online, tag.first_heard_ns, tag.last_heard_ns, tag.messages) == (True, 5_000, 5_000, 1)
    assert (tag.samples, tag.rejected, tag.settings) == ({"range": 3}, {"late": 1}, TagSettings())


def test_the_list_of_tags_includes_those_that_have_sent_nothing() -> None:
    bench = make_api_bench()
    bench.answers.tags.register("b")
    bench.answers.tags.register("a")
    tags = TagList.model_validate(ask(bench.app(), "GET", "/api/v1/tags").json()).tags
    assert [(tag.tag, tag.first_heard_ns) for tag in tags] == [("b", None), ("a", None)]


def test_pending_tags_are_listed_with_the_latest_sender_first() -> None:
    bench = make_api_bench()
    for name, t_ns in (("a", 10), ("b", 20), ("a", 30)):
        bench.answers.pending_tags.on_message(name, t_ns)
    app = bench.app()
    listed = PendingTagList.model_validate(ask(app, "GET", "/api/v1/pending-tags").json()).tags
    assert NewcomerList.model_validate(ask(app, "GET", "/api/v1/newcomers").json()).newcomers == listed
    assert [(n.tag, n.first_heard_ns, n.last_heard_ns, n.messages) for n in listed] == [
        ("a", 10, 30, 2),
        ("b", 20, 20, 1),
    ]


def test_settings_are_stored_and_register_a_new_tag() -> None:
    bench = make_api_bench()
    app = bench.app()
    settings = {"height_m": 1.5, "motion": "carried", "start": {"x": 1, "y": 2}}
    response = ask(app, "PUT", "/api/v1/tags/new%2Ftag/settings", json=settings)
    assert response.status_code == 200
    assert response.json() == TagSettings.model_validate(settings).model_dump()
    assert bench.answers.tags.find("new/tag") is not None
    assert bench.answers.site.tag_settings("new/tag").height_m == 1.5
    assert ask(app, "GET", "/api/v1/tags/new%2Ftag").json()["settings"] == response.json()
    assert ask(app, "GET", "/api/v1/tags/new%2Ftag/settings").json() == response.json()
    assert kind_of(ask(app, "GET", "/api/v1/tags/other/settings")) == "unknown-tag"


def test_no_more_than_max_tags_are_registered() -> None:
    bench = make_api_bench()
    app = bench.app(max_tags=1)
    assert ask(app, "PUT", "/api/v1/tags/a/settings", json={}).status_code == 200
    assert ask(app, "PUT", "/api/v1/tags/a/settings", json={}).status_code == 200
    assert kind_of(ask(app, "PUT", "/api/v1/tags/b/settings", json={})) == "tags-full"
    assert "b" not in bench.answers.site.tags


@pytest.mark.parametrize(
    ("body", "location"),
    [
        (b'{"height_m": NaN}', "body.height_m"),
        (b'{"height_m": -Infinity}', "body.height_m"),
        (b'{"range_std_m": 1e999}', "body.range_std_m"),
        (b'{"range_std_m": 0}', "body.range_std_m"),
        (b'{"range_scale": ' + b"9" * 400 + b"}", "body.range_scale"),
        (b'{"range_scale": ' + b"9" * 5000 + b"}", None),
        (b'{"height": 1}', "body.height"),
        (b'{"\\ud800": 1}', "body"),
        (b'{"heading_source": "\\udfff"}', "body.heading_source"),
        (b'{"motion": "train"}', "body.motion"),
        (b'{"start": {"x": 1}}', "body.start.y"),
        (b'{"start": []}', "body.start"),
        (b"[]", "body"),
        (b"null", "body"),
        (b"", "body"),
        (b'{"height_m": 1', "body.14"),
        (b"\xff\xfe", None),
        (b"[" * 100_000, None),
    ],
)
def test_invalid_settings_are_a_problem_that_names_the_field(body: bytes, location: str | None) -> None:
    bench = make_api_bench()
    headers = {"content-type": "application/json"}
    response = ask(bench.app(), "PUT", "/api/v1/tags/a/settings", content=body, headers=headers)
    assert kind_of(response) == "invalid-request"
    assert location is None or location in [part["location"] for part in response.json()["errors"]]
    assert len(bench.answers.tags) == 0


def test_a_body_without_the_json_media_type_is_a_problem() -> None:
    app = make_api_bench().app()
    response = ask(app, "PUT", "/api/v1/tags/a/settings", content=b"{}", headers={"content-type": "text/plain"})
    assert kind_of(response) == "invalid-request"


def test_a_problem_does_not_repeat_the_input() -> None:
    response = ask(make_api_bench().app(), "PUT", "/api/v1/tags/a/settings", json={"height_m": "a secret"})
    assert kind_of(response) == "invalid-request"
    assert "a secret" not in response.text


def test_the_site_is_replaced_as_a_whole() -> None:
    bench = make_api_bench()
    app = bench.app()
    site = {"name": "Yard", "georeference": {"lat": 50, "lon": 8}, "anchors": [{"id": "1"}, {"id": "2", "x": 4}]}
    assert ask(app, "PUT", "/api/v1/site", json=site).status_code == 200
    assert bench.answers.site.site == Site.model_validate(site)
    assert ask(app, "GET", "/api/v1/site").json() == Site.model_validate(site).model_dump()


def test_the_id_of_the_site_is_fixed() -> None:
    bench = make_api_bench()
    assert kind_of(ask(bench.app(), "PUT", "/api/v1/site", json={"id": "other"})) == "site-id-fixed"
    assert bench.answers.site.site.id == "default"


@pytest.mark.parametrize(
    "anchors", [[{"id": "1"}, {"id": "1"}], [{"id": ""}], [{"id": "a\nb"}], [{"id": "1", "x": "far"}], {}]
)
def test_invalid_anchors_are_a_problem(anchors: Any) -> None:
    assert kind_of(ask(make_api_bench().app(), "PUT", "/api/v1/site", json={"anchors": anchors})) == "invalid-request"


def test_an_anchor_is_placed_moved_read_and_removed() -> None:
    bench = make_api_bench()
    app = bench.app()
    path = "/api/v1/anchors/gate%2F1"
    assert kind_of(ask(app, "GET", path)) == "unknown-anchor"
    for x in (1.0, 2.0):
        assert ask(app, "PUT", path, json={"id": "gate/1", "x": x}).status_code == 200
    assert ask(app, "GET", path).json() == Anchor(id="gate/1", x=2.0).model_dump()
    assert [anchor["id"] for anchor in ask(app, "GET", "/api/v1/anchors").json()["anchors"]] == ["17", "gate/1"]
    removed = ask(app, "DELETE", path)
    assert (removed.status_code, removed.content) == (204, b"")
    assert kind_of(ask(app, "DELETE", path)) == "unknown-anchor"
    assert bench.answers.site.site.anchors == [Anchor(id="17")]


def test_the_ids_of_an_anchor_in_path_and_body_must_match() -> None:
    response = ask(make_api_bench().app(), "PUT", "/api/v1/anchors/1", json={"id": "2"})
    assert kind_of(response) == "anchor-id-differs"


def test_a_change_that_cannot_be_saved_is_not_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way of the folder")
    bench = make_api_bench(folder=tmp_path / "file")
    app = bench.app()
    assert kind_of(ask(app, "PUT", "/api/v1/anchors/1", json={"id": "1"})) == "not-saved"
    assert kind_of(ask(app, "PUT", "/api/v1/site", json={})) == "not-saved"
    assert kind_of(ask(app, "PUT", "/api/v1/tags/a/settings", json={})) == "not-saved"
    assert kind_of(ask(app, "DELETE", "/api/v1/anchors/17")) == "not-saved"
    assert (bench.answers.site.site.anchors, len(bench.answers.tags)) == ([Anchor(id="17")], 0)


@pytest.mark.parametrize("escaped", ["*", "%2A", "forklift-*"])
def test_a_pattern_instead_of_a_tag_is_refused_with_an_explanation(escaped: str) -> None:
    bench = make_api_bench()
    response = ask(bench.app(), "PUT", f"/api/v1/tags/{escaped}/settings", json={})
    assert kind_of(response) == "invalid-request"
    assert "there are no settings for all tags" in response.json()["detail"]
    assert len(bench.answers.tags) == 0
