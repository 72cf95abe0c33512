"""Whom a service believes about a client: API nodes that show the secret, and nobody else."""

import asyncio
import json

import httpx
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send

from dropanchor_service.api.http.of_cluster import FromNodes, NamesOwner, epoch_in
from support.api import kind_of

SECRET = "the secret of the nodes"
ABOUT = {"x-forwarded-for": "10.9.8.7", "x-forwarded-host": "api.example", "x-forwarded-proto": "https"}


async def echo(scope: Scope, receive: Receive, send: Send) -> None:
    request = Request(scope)
    assert request.client is not None
    seen = {"client": request.client.host, "url": str(request.url), "node": request.headers.get("dropanchor-node")}
    await JSONResponse(seen)(scope, receive, send)


def answer(secret: bytes | None, **shown: str) -> httpx.Response:
    async def ask() -> httpx.Response:
        app = NamesOwner(FromNodes(echo, secret), "yard 1", 7)
        transport = httpx.ASGITransport(app, client=("10.0.0.1", 1234))
        async with httpx.AsyncClient(transport=transport, base_url="http://shard:8080") as client:
            return await client.get("/a", headers={**ABOUT, **{name.replace("_", "-"): shown[name] for name in shown}})

    return asyncio.run(ask())


def test_a_node_with_the_secret_is_believed_about_its_client() -> None:
    seen = answer(SECRET.encode(), dropanchor_node=SECRET)
    assert json.loads(seen.text) == {"client": "10.9.8.7", "url": "https://api.example/a", "node": None}
    assert epoch_in(seen.headers, "yard 1") == 7
    assert epoch_in(seen.headers, "yard") is None


def test_nobody_else_is_believed() -> None:
    assert json.loads(answer(SECRET.encode()).text)["client"] == "10.0.0.1"
    for secret, sentence in ((SECRET.encode(), "is not that of this service"), (None, "set cluster.node_secret")):
        refused = answer(secret, dropanchor_node="another secret of nodes")
        assert (kind_of(refused), sentence in refused.text) == ("forbidden", True)
