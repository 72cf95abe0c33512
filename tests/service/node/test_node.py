"""The process of a node: what it refuses to start with, and what it says while it has no database."""

from pathlib import Path
from typing import Any

import httpx
import pytest

from dropanchor_service.node.node import Node
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from support.api import kind_of
from support.zenoh_router import free_port, wait_until


def settings_of(folder: Path, **http: Any) -> Settings:
    secret = folder / "node.secret"
    secret.write_text("a secret of this test")
    url = f"postgresql://nobody@127.0.0.1:{free_port()}/nothing"
    cluster = {"url": url, "bucket": "any", "node_secret": secret}
    return Settings.model_validate({"http": {"port": 0, **http}, "cluster": cluster})


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"url": None, "bucket": None}, "cluster.url: say which database"),
        ({"node_secret": None}, "cluster.node_secret: name the file"),
    ],
)
def test_a_node_needs_a_database_and_a_secret(changed: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    settings = settings_of(tmp_path)
    with pytest.raises(SettingsError, match=sentence):
        Node(settings.model_copy(update={"cluster": settings.cluster.model_copy(update=changed)}))


def test_a_node_listens_on_the_network_only_with_credentials(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"HTTP at 0\.0\.0\.0 would be open to the network without credentials"):
        Node(settings_of(tmp_path, host="0.0.0.0"))


def test_a_node_that_never_reached_the_database_is_not_ready_and_has_the_page(tmp_path: Path) -> None:
    with Node(settings_of(tmp_path)) as node, httpx.Client(base_url=node.url, trust_env=False, verify=False) as client:
        wait_until(lambda: "connection" in client.get("/api/v1/health/ready").text)
        assert client.get("/api/v1/health/ready").status_code == 503
        refused = client.get("/api/v1/sites/017.yard/poses")
        assert (kind_of(refused), "has not found the owners" in refused.text) == ("not-ready", True)
        assert 'src="page/main.js"' in client.get("/").text
        assert client.get("/api/v1/health/live").status_code == 200
        assert "dropanchor_node_buckets 0.0" in client.get("/metrics").text
