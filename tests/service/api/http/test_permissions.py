"""What each credential may do: the table of the reference page against a running service, cell by cell."""

import json
from collections.abc import Iterator
from dataclasses import dataclass

import httpx
import pytest
from fastapi import FastAPI
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from dropanchor_evaluation.reference.access_page import HOLDERS, SOCKET, allows, operations_of
from dropanchor_evaluation.reference.export import FOLDER
from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import RemoteSettings, StartPose, TagSettings
from dropanchor_service.api.http.permissions import Need
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from dropanchor_service.store.omlox_items import OmloxItems
from support.api import ApiBench, make_api_bench
from support.http_server import running_server
from support.patience import PATIENCE_S


@dataclass
class Asked:
    """A running service with a tag `a`. secrets: one for each holder of the table; None: no credentials."""

    app: FastAPI
    secrets: dict[Need, str | None]
    client: httpx.Client
    bench: ApiBench

    def refusal(self, method: str, path: str, has: Need) -> str:
        """Return the type of the problem if the access control refuses a request, else nothing."""
        for name in ("tag", "trackable_id", "provider_id"):
            path = path.replace(f"{{{name}}}", "a")
        path = path.replace("{", "").replace("}", "")
        response = self.client.request(method, path, headers=self.headers(has))
        kind = response.json().get("type", "") if "problem" in response.headers.get("content-type", "") else ""
        return kind if kind.endswith((":unauthenticated", ":forbidden")) else ""

    def headers(self, has: Need) -> dict[str, str]:
        secret = self.secrets[has]
        return {} if secret is None else {"authorization": f"Bearer {secret}"}

    def read(self, path: str, has: Need) -> str:
        return self.client.get(f"/api/v1/{path}", headers=self.headers(has)).raise_for_status().text


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Asked]:
    folder = tmp_path_factory.mktemp("security")
    keys, links = ApiKeys(folder), ShareLinks(folder)
    bench = make_api_bench()
    authenticator = Authenticator({share_links.SOURCE: links, api_keys.SOURCE: keys})
    app = bench.app(authenticator=authenticator, omlox=OmloxItems.opened(None))
    secrets: dict[Need, str | None] = {Need[scope.name]: keys.add(scope.word, scope) for scope in Scope}
    secrets |= {
        Need.NOTHING: None,
        Need.TAG: keys.add_for_tag("tag", "a"),
        Need.LINK: links.add("default", ShareRequest())[1],
        Need.LINK_TO_TAGS: links.add("default", ShareRequest(tag="a"))[1],
    }
    bench.stopping.set()  # a stream ends after its first event
    with (
        running_server(app, bench.stopping) as port,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", trust_env=False, verify=False) as client,
    ):
        yield Asked(app, secrets, client, bench)


@pytest.mark.parametrize("has", HOLDERS.values(), ids=lambda need: need.name.lower())
def test_each_credential_does_what_the_table_says_and_nothing_else(asked: Asked, has: Need) -> None:
    operations = [one for one in operations_of(asked.app) if one[0] != SOCKET]
    assert len(operations) > 110
    wrong = [
        (method, path, refusal)
        for method, path, need in operations
        if bool(refusal := asked.refusal(method, path, has)) == allows(has, need)
    ]
    assert wrong == []


@pytest.mark.parametrize("has", HOLDERS.values(), ids=lambda need: need.name.lower())
def test_each_credential_opens_the_web_sockets_that_the_table_says(asked: Asked, has: Need) -> None:
    needs = {path: need for method, path, need in operations_of(asked.app) if method == SOCKET}
    assert set(needs) == {"/api/v1/ingest/stream", "/omlox/v2/ws/socket"}
    asked.bench.stopping.clear()
    opened = {path: _opens(asked, path, has) for path in needs}
    asked.bench.stopping.set()
    assert opened == {path: allows(has, need) for path, need in needs.items()}


def _opens(asked: Asked, path: str, has: Need) -> bool:
    url = f"ws://127.0.0.1:{asked.client.base_url.port}{path}"
    with connect(url, additional_headers=asked.headers(has), proxy=None) as socket:
        try:
            if "omlox" in path:
                socket.send(json.dumps({"event": "subscribe", "topic": "proximity_updates"}))
            return bool(json.loads(socket.recv(PATIENCE_S)).get("event") != "error")
        except ConnectionClosed as closed:
            return closed.rcvd is not None and closed.rcvd.code not in (4401, 4403)


@pytest.mark.parametrize(("has", "height_m"), [(Need.LINK_TO_TAGS, 0.0), (Need.LINK, 1.75), (Need.READ, 1.75)])
def test_a_link_reads_no_more_of_a_tag_than_the_page_draws(asked: Asked, has: Need, height_m: float) -> None:
    settings = TagSettings(name="Cart", height_m=1.75, range_bias_m=0.125, start=StartPose(x=9.5, y=8.5))
    asked.bench.move("a")
    asked.bench.answers.site.set_tag("a", settings)
    asked.bench.answers.site.set_remote("a", RemoteSettings(batch_s=0.4))
    (listed, *_), one = json.loads(asked.read("tags", has))["tags"], json.loads(asked.read("tags/a", has))
    for status in (listed, one):
        shown, is_shown = status["settings"], has is Need.READ
        assert (shown["name"], shown["height_m"]) == ("Cart", height_m)
        assert (shown["range_bias_m"] == 0.125, shown["start"] is not None) == (is_shown, is_shown)
        assert (status["remote_settings"]["wanted"]["batch_s"] == 0.4) == is_shown


def test_a_new_route_is_not_open_to_links(asked: Asked) -> None:
    for has in (Need.NOTHING, Need.TAG, Need.LINK_TO_TAGS, Need.LINK):
        assert asked.refusal("GET", "/api/v1/whatever-comes-next", has)
        assert asked.refusal("GET", "/api/v1/tags/a/whatever-comes-next", has)


def test_the_page_has_a_column_for_each_credential_and_a_row_for_each_request(asked: Asked) -> None:
    text = (FOLDER / "reference" / "access.md").read_text(encoding="utf-8")
    assert "| request | none | key of a tag | link to tags | link | `read` | `write` | `admin` |" in text
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    assert len(rows) == len(operations_of(asked.app))
    assert "| `GET /api/v1/tags/{tag}/settings` |  |  |  |  | ✓ | ✓ | ✓ |" in rows
    assert "| `GET /api/v1/destinations` |  |  |  |  | ✓ | ✓ | ✓ |" in rows
    assert "| `PUT /api/v1/receiver-networks/{network}` |  |  |  |  |  |  | ✓ |" in rows
    assert "| `GET /api/v1/shares` |  |  |  |  |  |  | ✓ |" in rows
