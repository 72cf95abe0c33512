"""What a service believes about the path below which a proxy has it, and whom."""

import asyncio
from pathlib import Path
from threading import Event

import httpx
import pytest
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send

from dropanchor_service.api.http.behind_proxy import BehindProxy, prefix_of
from dropanchor_service.api.http.of_cluster import FromNodes
from dropanchor_service.node.request import headers_for_owner
from support.api import make_api_bench
from support.http_server import running_server

ABOUT = {"x-forwarded-for": "10.9.8.7", "x-forwarded-proto": "https", "x-forwarded-prefix": "/rtls"}


async def echo(scope: Scope, receive: Receive, send: Send) -> None:
    request = Request(scope)
    assert request.client is not None
    seen = {"client": request.client.host, "scheme": request.url.scheme, "prefix": prefix_of(request)}
    await JSONResponse(seen)(scope, receive, send)


def seen(trusted: list[str], **more: str) -> dict[str, str]:
    async def ask_it() -> httpx.Response:
        transport = httpx.ASGITransport(BehindProxy(echo, trusted), client=("10.0.0.1", 1234))
        async with httpx.AsyncClient(transport=transport, base_url="http://yard:8080") as client:
            return await client.get("/a", headers=ABOUT | more)

    return dict(asyncio.run(ask_it()).json())


def test_a_trusted_proxy_is_believed_and_nobody_else() -> None:
    assert seen(["10.0.0.1"]) == {"client": "10.9.8.7", "scheme": "https", "prefix": "/rtls"}
    assert seen(["10.0.0.0/30"]) == {"client": "10.9.8.7", "scheme": "https", "prefix": "/rtls"}
    assert seen(["127.0.0.1"]) == {"client": "10.0.0.1", "scheme": "http", "prefix": ""}


@pytest.mark.parametrize(
    "prefix", ["//evil.example", "https://evil.example", "/a b", "/a?b", "/a#b", "rtls", "/../x\\", "/" * 9, ""]
)
def test_what_is_no_path_is_no_prefix(prefix: str) -> None:
    assert seen(["10.0.0.1"], **{"x-forwarded-prefix": prefix})["prefix"] == ""


@pytest.mark.parametrize("prefix", ["/rtls/", "/rtls"])
def test_a_slash_at_the_end_does_not_matter(prefix: str) -> None:
    assert seen(["10.0.0.1"], **{"x-forwarded-prefix": prefix})["prefix"] == "/rtls"


def test_a_node_tells_the_owner_and_no_client_can() -> None:
    def owner_sees(state: dict[str, str]) -> str:
        headers = [(b"host", b"api.example"), (b"x-forwarded-prefix", b"/of-a-client")]
        scope: Scope = {
            "type": "http",
            "scheme": "https",
            "headers": headers,
            "client": ("10.9.8.7", 1),
            "state": state,
            "path": "/a",
            "raw_path": b"/a",
            "query_string": b"",
            "method": "GET",
        }
        told = headers_for_owner(scope, b"secret", "1")

        async def ask_it() -> httpx.Response:
            transport = httpx.ASGITransport(FromNodes(echo, b"secret"))
            async with httpx.AsyncClient(transport=transport, base_url="http://shard:8080") as client:
                return await client.get("/a", headers=told)

        return str(asyncio.run(ask_it()).json()["prefix"])

    assert owner_sees({"prefix": "/rtls"}) == "/rtls"
    assert owner_sees({}) == ""


@pytest.mark.parametrize(
    ("path", "location"),
    [
        ("/docs", "./docs/"),
        ("/tag?site=a", "./tag/?site=a"),
        ("/openapi.json", "api/v1/openapi.json"),
        ("/api/v1/docs", "../../docs/"),
    ],
)
def test_redirects_are_relative_and_lead_to_the_right_place(path: str, location: str) -> None:
    bench = make_api_bench()
    with running_server(bench.app(Path(__file__).parents[4] / "service/dropanchor_service/dashboard"), Event()) as port:
        answer = httpx.get(f"http://127.0.0.1:{port}{path}", trust_env=False, verify=False)
        assert (answer.status_code, answer.headers["location"]) == (307, location)
        followed = httpx.get(f"http://127.0.0.1:{port}{path}", trust_env=False, verify=False, follow_redirects=True)
        assert followed.status_code == 200
