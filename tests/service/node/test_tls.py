"""Between a node and the owners, HTTPS and WebSockets are encrypted, and certificates are checked."""

import json
from pathlib import Path
from threading import Event

import httpx
from websockets.sync.client import connect

from dropanchor_service.node.owners import Owner
from dropanchor_service.security.certificate import Certificate
from support.api import kind_of
from support.api_nodes import BareNode, of_owner
from support.certificate import self_signed
from support.http_server import running_server
from support.patience import PATIENCE_S
from support.sites import app_of_sites, make_sites

POSE = "/api/v1/tags/cart/pose"


def test_an_owner_needs_a_certificate_that_the_node_trusts(tmp_path: Path) -> None:
    certificate = Certificate(*self_signed(tmp_path))
    app = of_owner(app_of_sites(make_sites("a"), stopping=Event()), "yard")
    trusting, other = BareNode(authority=certificate.certificate), BareNode()
    with running_server(app, Event(), certificate=certificate) as port:
        owner = Owner("yard", 1, "a", f"https://127.0.0.1:{port}")
        with trusting.running(owner) as url, other.running(owner) as url_of_other:
            assert httpx.get(f"{url}{POSE}", trust_env=False, verify=False).json()["tag"] == "cart"
            with connect(f"ws{url.removeprefix('http')}/api/v1/ingest/stream?tag=anna", proxy=None) as socket:
                assert json.loads(socket.recv(PATIENCE_S))["tag"] == "anna"
            refused = httpx.get(f"{url_of_other}{POSE}", trust_env=False, verify=False)
    assert (kind_of(refused), "cannot be reached" in refused.text) == ("not-ready", True)
