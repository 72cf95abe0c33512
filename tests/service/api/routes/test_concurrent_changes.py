"""Changes of anchors and tags by several clients, and what each client may do."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.store import SiteStore
from support.api import ask, kind_of, make_api_bench
from support.event_stream import serving, streaming

SITE = "/api/v1/site"
ANCHOR = "/api/v1/anchors/17"
SETTINGS = "/api/v1/tags/cart/settings"


def test_a_change_that_names_the_current_anchor_is_made_and_one_that_names_an_older_is_not() -> None:
    bench = make_api_bench()
    app = bench.app()
    first = ask(app, "GET", ANCHOR).headers["etag"]
    moved = ask(app, "PUT", ANCHOR, json={"id": "17", "x": 1.0}, headers={"if-match": first})
    assert (moved.status_code, moved.headers["etag"]) == (200, ask(app, "GET", ANCHOR).headers["etag"])
    late = ask(app, "PUT", ANCHOR, json={"id": "17", "x": 2.0}, headers={"if-match": first})
    assert kind_of(late) == "changed-meanwhile"
    assert kind_of(ask(app, "DELETE", ANCHOR, headers={"if-match": first})) == "changed-meanwhile"
    assert [anchor.x for anchor in bench.answers.site.site.anchors] == [1.0]
    either = f"{first}, {moved.headers['etag']}"
    assert ask(app, "DELETE", ANCHOR, headers={"if-match": either}).status_code == 204
    assert kind_of(ask(app, "PUT", ANCHOR, json={"id": "17"}, headers={"if-match": "*"})) == "changed-meanwhile"


def test_an_anchor_that_must_be_new_replaces_none() -> None:
    app = make_api_bench().app()
    new = {"if-none-match": "*"}
    assert kind_of(ask(app, "PUT", ANCHOR, json={"id": "17"}, headers=new)) == "changed-meanwhile"
    assert ask(app, "PUT", "/api/v1/anchors/18", json={"id": "18"}, headers=new).status_code == 200


def test_of_many_changes_of_a_site_that_one_has_read_one_is_made() -> None:
    app = make_api_bench().app()
    read = ask(app, "GET", SITE)
    assert kind_of(ask(app, "PUT", SITE, json=read.json(), headers={"if-match": '"nonsense"'})) == "changed-meanwhile"
    assert kind_of(ask(app, "PUT", SITE, json=read.json(), headers={"if-none-match": "*"})) == "changed-meanwhile"
    seen = {"if-match": read.headers["etag"]}

    def change(number: int) -> httpx.Response:
        return ask(app, "PUT", SITE, json=read.json() | {"name": f"Yard {number}"}, headers=seen)

    with ThreadPoolExecutor(16) as pool:
        answers = list(pool.map(change, range(16)))
    (made,) = [answer for answer in answers if answer.status_code == 200]
    assert {kind_of(answer) for answer in answers if answer is not made} == {"changed-meanwhile"}
    now = ask(app, "GET", SITE)
    assert (now.json(), now.headers["etag"]) == (made.json(), made.headers["etag"])
    assert ask(app, "PUT", SITE, json=read.json()).status_code == 200


def test_settings_of_a_tag_are_not_overwritten_unseen() -> None:
    bench = make_api_bench()
    bench.move("cart")
    app = bench.app()
    first = ask(app, "GET", SETTINGS).headers["etag"]
    assert ask(app, "PUT", SETTINGS, json={"name": "A"}, headers={"if-match": first}).status_code == 200
    assert kind_of(ask(app, "PUT", SETTINGS, json={"name": "B"}, headers={"if-match": first})) == "changed-meanwhile"
    assert bench.answers.site.tag_settings("cart").name == "A"


@pytest.mark.parametrize("bad", [{"colour": "red"}, {"name": "a\nb"}, {"group": "x" * 65}])
def test_a_name_a_colour_and_a_group_have_a_form(bad: dict[str, str]) -> None:
    assert kind_of(ask(make_api_bench().app(), "PUT", SETTINGS, json=bad)) == "invalid-request"


def test_a_deleted_tag_is_gone_until_it_sends_or_is_registered_again(tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path)
    bench.move("cart", "van")
    tags = bench.answers.tags
    app = bench.app()
    ask(app, "PUT", SETTINGS, json={"name": "A"}).raise_for_status()
    assert ask(app, "DELETE", "/api/v1/tags/cart").status_code == 204
    assert [tag["tag"] for tag in ask(app, "GET", "/api/v1/tags").json()["tags"]] == ["van"]
    assert [pose["tag"] for pose in ask(app, "GET", "/api/v1/poses").json()["poses"]] == ["van"]
    assert kind_of(ask(app, "GET", "/api/v1/tags/cart")) == "unknown-tag"
    assert kind_of(ask(app, "DELETE", "/api/v1/tags/cart")) == "unknown-tag"
    assert "cart" not in SiteStore(bench.answers.site.site, {}, tmp_path).tags
    tags.register("cart")
    assert ask(app, "GET", "/api/v1/tags/cart").json()["settings"] == TagSettings().model_dump()


def test_a_stream_tells_that_settings_have_changed() -> None:
    bench = make_api_bench()
    bench.move("cart")
    with serving(bench) as port, streaming(port) as events:
        assert next(events)[0] == "snapshot"
        bench.answers.site.set_tag("cart", TagSettings(start=StartPose(x=1.0, y=2.0)))
        assert next(events) == ("settings", {"t_ns": bench.now_ns})


def test_a_client_learns_what_it_may_do(tmp_path: Path) -> None:
    bench = make_api_bench()
    assert ask(bench.app(), "GET", "/api/v1/access").json() == {"scope": "admin"}
    keys = ApiKeys(tmp_path)
    app = bench.app(authenticator=Authenticator({SOURCE: keys}))
    for scope in Scope:
        headers = {"authorization": f"Bearer {keys.add(scope.word, scope)}"}
        assert ask(app, "GET", "/api/v1/access", headers=headers).json() == {"scope": scope.word}


def test_a_deleted_tag_gets_its_settings_back_unless_somebody_has_set_others() -> None:
    bench = make_api_bench()
    app = bench.app()
    for path in ("/api/v1/tags/cart", "/api/v1/tags/van"):
        ask(app, "PUT", f"{path}/settings", json={"name": "Old"})
        left = ask(app, "DELETE", path).headers["etag"]
        if path.endswith("van"):
            ask(app, "PUT", f"{path}/settings", json={"name": "Theirs"})
        ask(app, "PUT", f"{path}/settings", json={"name": "Old"}, headers={"if-match": left})
    assert [bench.answers.site.tag_settings(tag).name for tag in ("cart", "van")] == ["Old", "Theirs"]
