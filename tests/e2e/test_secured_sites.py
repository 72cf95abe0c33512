"""One service and one router serve two sites with certificates and keys: each tag and each key stays in its site."""

import json
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_tag_client import TagClient, read_credentials
from support.patience import PATIENCE_S
from support.service import running_router, running_service, straight_north
from support.zenoh_router import free_port, wait_until

SETTINGS = """
[history]
enabled = false
[sites.north.site]
anchors = [{ id = "7" }]
[sites.south.site]
anchors = [{ id = "7" }]
"""


def test_two_sites_share_a_secured_service_and_a_router(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, port, config = tmp_path / "security", free_port(), tmp_path / "sites.toml"
    config.write_text(SETTINGS)

    def run(*words: str) -> str:
        capsys.readouterr()
        assert main([*words, "--security", str(folder)]) == 0
        return capsys.readouterr().out.strip()

    run("security", "init", "--host", "localhost", "--listen", f"tls/127.0.0.1:{port}", "--site", "north")
    run("security", "add-site", "south")
    bundles = []
    for site in ("north", "south"):
        run("tag", "add", "cart", "--site", site)
        bundles.append(folder / "tags" / ("cart" if site == "north" else f"{site}%2Fcart"))
    everywhere = {"authorization": f"Bearer {run('key', 'add', 'board', '--scope', 'read')}"}
    of_north = {"authorization": f"Bearer {run('key', 'add', 'north', '--scope', 'admin', '--site', 'north')}"}
    phone = {"authorization": f"Bearer {run('key', 'add', 'phone', '--tag', 'anna', '--site', 'south')}"}
    options = ("--config", str(config), "--security", str(folder), "--zenoh-connect", f"tls/localhost:{port}")
    with running_router("--security", str(folder)), running_service(*options, ca=folder / "ca.pem") as service:

        def messages(site: str, tag: str) -> int:
            response = service.ask("GET", f"/api/v1/sites/{site}/tags/{tag}", headers=everywhere)
            return int(response.json().get("messages", 0))

        for bundle in bundles:
            credentials = read_credentials(bundle)
            with TagClient(
                credentials.tag, site=credentials.site, connect=credentials.session, connect_timeout_s=PATIENCE_S
            ) as client:
                for sample in straight_north(5).ranges:
                    client.publish_range("7", sample.range_m, t_ns=sample.t_ns)
                client.flush()
                wait_until(lambda site=credentials.site: messages(site, "cart") > 0)  # type: ignore[misc]
        range_s = straight_north(5).ranges[0]
        body = json.dumps({"range": [{"t_ns": range_s.t_ns, "anchor": "7", "range_m": range_s.range_m}]})
        sent = service.ask(
            "POST", "/api/v1/ingest/samples", headers=phone | {"content-type": "application/json"}, content=body
        )
        assert sent.status_code == 202, sent.text
        wait_until(lambda: messages("south", "anna") > 0)
        assert messages("north", "anna") == 0
        for site, status in (("north", 200), ("south", 403)):
            assert service.ask("GET", f"/api/v1/sites/{site}/poses", headers=of_north).status_code == status
        listed = service.ask("GET", "/api/v1/sites", headers=of_north).json()["sites"]
        assert [site["site"] for site in listed] == ["north"]
        assert service.ask("GET", "/").headers["location"] == "sites/"
        assert "page/main.js" in service.ask("GET", "/?site=north").text
        assert service.stop() == 0
