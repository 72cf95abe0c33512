"""Share links over REST: who may create them, what they show, and that they end."""

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import jwt
import pytest
from websockets.sync.client import connect

from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import TagSettings
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope, UnauthenticatedError
from dropanchor_service.security.share_links import KEY_FILE, PREFIX, TABLE_FILE, ShareLinks
from dropanchor_service.store.omlox_items import OmloxItems
from support.api import ask, kind_of, make_api_bench
from support.http_server import running_server
from support.patience import PATIENCE_S

DAY_S = 86_400
SHOWS = {"poses": "poses", "tags": "tags"}


class Shared:
    """A guarded interface with three tags, one of them in a group."""

    def __init__(self, folder: Path) -> None:
        self.now_s = 1_800_000_000.0
        self.links = ShareLinks(folder, lambda: self.now_s)
        keys = ApiKeys(folder)
        self.secrets = {scope: keys.add(scope.word, scope) for scope in Scope}
        self.bench = make_api_bench()
        self.bench.move("a", "b", "c d", "a,b")
        self.bench.answers.site.set_tag("b", TagSettings(group="forklifts"))
        authenticator = Authenticator({share_links.SOURCE: self.links, api_keys.SOURCE: keys})
        self.app = self.bench.app(authenticator=authenticator, omlox=OmloxItems.opened(None))

    def ask(self, method: str, path: str, secret: str | Scope = Scope.ADMIN, **options: Any) -> httpx.Response:
        bearer = self.secrets[secret] if isinstance(secret, Scope) else secret
        return ask(self.app, method, f"/api/v1/{path}", headers={"authorization": f"Bearer {bearer}"}, **options)

    def create(self, **request: Any) -> dict[str, Any]:
        response = self.ask("POST", "shares", json=request)
        assert response.status_code == 201, response.text
        created: dict[str, Any] = response.json()
        return created

    def seen(self, path: str, secret: str) -> list[str]:
        """Return the tags in a list of poses or of tags."""
        response = self.ask("GET", path, secret)
        assert response.status_code == 200, response.text
        return sorted(one["tag"] for one in response.json()[path.split("?")[0]])


@pytest.fixture
def shared(tmp_path: Path) -> Shared:
    return Shared(tmp_path)


def test_a_link_reads_everything_like_a_reader_and_changes_nothing(shared: Shared) -> None:
    link = shared.create(name="Visitors", view="tag=a&lang=de")
    secret = link["secret"]
    assert link["path"] == f"/#tag=a&lang=de&share={secret}"
    assert link["expires_ns"] - link["made_ns"] == 7 * DAY_S * 10**9
    assert shared.seen("poses", secret) == ["a", "a,b", "b", "c d"]
    assert shared.ask("GET", "access", secret).json() == {"scope": "read"}
    assert shared.ask("GET", "basemap", secret).json() == {"tiles": None}
    for method, path in (("PUT", "tags/a/settings"), ("DELETE", "tags/a"), ("POST", "shares"), ("GET", "shares")):
        assert kind_of(shared.ask(method, path, secret, json={} if method != "GET" else None)) == "forbidden"


@pytest.mark.parametrize(
    ("limit", "tags"), [({"tag": "c d"}, ["c d"]), ({"tag": "a,b"}, ["a,b"]), ({"group": "forklifts"}, ["b"])]
)
def test_a_link_of_a_tag_or_a_group_shows_these_tags_however_one_asks(
    shared: Shared, limit: dict[str, str], tags: list[str]
) -> None:
    secret = shared.create(**limit)["secret"]
    for query in ("", "?tags=a", "?tags=a&tags=b,c d", "?tags=a;b"):
        for path in ("poses", "tags"):
            assert set(shared.seen(f"{path}{query}", secret)) <= set(tags)
        assert shared.seen("poses", secret) == shared.seen("tags", secret) == tags
    for query in ("?group=", "?group=forklifts&group="):
        assert set(shared.seen(f"poses{query}", secret)) <= set(tags)
    for tag in ("a", "b", "c d", "a,b"):
        status = shared.ask("GET", f"tags/{quote(tag)}/pose", secret).status_code
        assert status == (200 if tag in tags else 403)
    for path in (
        "events",
        "zone-occupancy",
        "zones",
        "webhooks",
        "recordings",
        "pending-tags",
        "newcomers",
        "tag-groups",
        "plans",
        "basemap",
        "basemap/0/0/0",
        "../../metrics",
    ):
        assert shared.ask("GET", path, secret).status_code == 403, path


@pytest.mark.parametrize(("limit", "answer"), [({}, "subscribed"), ({"tag": "a"}, "error"), ({"group": "x"}, "error")])
def test_a_link_of_a_tag_or_a_group_opens_no_feed_of_all_tags(
    shared: Shared, limit: dict[str, str], answer: str
) -> None:
    secret = shared.create(**limit)["secret"]
    with running_server(shared.app, shared.bench.stopping) as port:
        url = f"ws://127.0.0.1:{port}/omlox/v2/ws/socket"
        with connect(url, proxy=None) as socket:
            request = {"event": "subscribe", "topic": "location_updates", "params": {"token": secret}}
            socket.send(json.dumps(request))
            assert json.loads(socket.recv(PATIENCE_S))["event"] == answer


def test_a_link_of_a_group_follows_its_members_and_of_an_empty_one_shows_nothing(shared: Shared) -> None:
    secret = shared.create(group="forklifts")["secret"]
    shared.bench.answers.site.set_tag("a", TagSettings(group="forklifts"))
    assert shared.seen("poses", secret) == shared.seen("tags", secret) == ["a", "b"]
    for tag in ("a", "b"):
        shared.bench.answers.site.set_tag(tag, TagSettings())
    assert shared.seen("poses", secret) == []
    assert kind_of(shared.ask("GET", "tags", secret)) == "forbidden"


def test_a_link_ends_when_it_expires_and_says_so(shared: Shared) -> None:
    secret = shared.create(valid_s=60)["secret"]
    shared.now_s += 59
    assert shared.ask("GET", "poses", secret).status_code == 200
    shared.now_s += 1
    response = shared.ask("GET", "poses", secret)
    assert kind_of(response) == "unauthenticated"
    assert "the share link has expired" in response.json()["detail"]
    assert [one["name"] for one in shared.ask("GET", "shares").json()["shares"]] == [""]


def test_a_revoked_link_ends_and_so_do_its_streams(shared: Shared) -> None:
    link = shared.create(tag="a")
    headers = {"authorization": f"Bearer {link['secret']}"}
    with running_server(shared.app, shared.bench.stopping) as port:
        url = f"http://127.0.0.1:{port}/api/v1/stream?max_hz=30&tags=b"
        with httpx.stream("GET", url, headers=headers, trust_env=False, verify=False) as stream:
            lines = stream.iter_lines()
            assert next(lines) == "event: snapshot"
            assert '"tags":["a"]' in next(lines)
            assert shared.ask("DELETE", f"shares/{link['id']}").status_code == 204
            for number in range(20):
                shared.bench.move("a", x=float(number))
                if not list(zip(range(3), lines, strict=False)):
                    break
            assert list(lines) == []
    assert "was revoked" in shared.ask("GET", "poses", link["secret"]).json()["detail"]
    assert kind_of(shared.ask("DELETE", f"shares/{link['id']}")) == "unknown-share"


def test_only_the_key_of_the_service_signs_links(shared: Shared, tmp_path: Path) -> None:
    link = shared.create(tag="a")
    claims = jwt.decode(link["secret"].removeprefix(PREFIX), options={"verify_signature": False})
    forged = [
        PREFIX + jwt.encode(claims | {"tag": None}, b"x" * 32, "HS256"),
        PREFIX + jwt.encode(claims, "", "none"),
        link["secret"][:-2] + ("AA" if link["secret"][-2:] != "AA" else "BB"),
        PREFIX + "a.b.c",
        PREFIX,
    ]
    for secret in forged:
        assert kind_of(shared.ask("GET", "poses", secret)) == "unauthenticated"
    assert (tmp_path / KEY_FILE).stat().st_mode & 0o077 == 0
    assert link["secret"] not in (tmp_path / TABLE_FILE).read_text()


def test_links_survive_a_restart_and_damage_is_reported(shared: Shared, tmp_path: Path) -> None:
    secret = shared.create()["secret"]
    again = ShareLinks(tmp_path, lambda: shared.now_s)
    assert again.identify(secret).of_sites == {"default": Scope.READ}
    (tmp_path / KEY_FILE).write_bytes(b"short")
    recovery = Recovery(tmp_path)
    other = ShareLinks(tmp_path, lambda: shared.now_s, recovery=recovery)
    assert [link.site for link in other.of_site("default")] == ["default"]
    with pytest.raises(UnauthenticatedError, match="another service made it"):  # the key is another one
        other.identify(secret)
    (tmp_path / TABLE_FILE).write_text("{")
    assert ShareLinks(tmp_path, recovery=recovery).of_site("default") == []
    assert [sentence.partition(":")[0] for sentence in recovery.problems()] == [
        f"{name} is damaged; all share links have ended" for name in (KEY_FILE, TABLE_FILE)
    ]


def test_two_processes_with_one_list_lose_no_link(tmp_path: Path) -> None:
    one, other = ShareLinks(tmp_path), ShareLinks(tmp_path)
    one.add("yard", ShareRequest(name="a", valid_s=3600))
    other.add("yard", ShareRequest(name="b", valid_s=3600))
    assert {link.name for link in ShareLinks(tmp_path).of_site("yard")} == {"a", "b"}


@pytest.mark.parametrize(
    "request_", [{"valid_s": 1}, {"tag": "a", "group": "b"}, {"tag": ".."}, {"group": ""}, {"view": "a b"}, {"x": 1}]
)
def test_a_request_that_makes_no_sense_is_refused(shared: Shared, request_: dict[str, Any]) -> None:
    assert kind_of(shared.ask("POST", "shares", json=request_)) == "invalid-request"


@pytest.mark.parametrize("scope", [Scope.READ, Scope.WRITE])
def test_only_an_administrator_shares(shared: Shared, scope: Scope) -> None:
    assert kind_of(shared.ask("POST", "shares", scope, json={})) == "forbidden"
    assert kind_of(shared.ask("GET", "shares", scope)) == "forbidden"


def test_without_access_control_there_is_nothing_to_share() -> None:
    app = make_api_bench().app()
    assert ask(app, "GET", "/api/v1/shares").json() == {"available": False, "shares": []}
    response = ask(app, "POST", "/api/v1/shares", json={})
    assert kind_of(response) == "no-access-control"
    assert "send the address of the page" in response.json()["detail"]
