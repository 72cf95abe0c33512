"""`dropanchor status` shows what a running service answers, and its exit code says whether all is well."""

import json
from pathlib import Path

from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Scope
from support.commands import Ended
from support.secured import secured_site
from support.service import ended, running_service
from support.yard import running_yard
from support.zenoh_router import free_endpoint, free_port, wait_until

ZONE = {"id": "dock", "shape": {"type": "circle", "x": 10.0, "y": 0.0, "radius_m": 500.0}}


def status(url: str, *options: str, **variables: str) -> Ended:
    return ended("status", "--url", url, *options, **variables)


def test_tags_zones_events_and_what_is_refused_are_shown(tmp_path: Path) -> None:
    with running_yard(tmp_path, "forklift-7") as yard:
        yard.put("/api/v1/zones/dock", ZONE)
        junk = b'{"range": [{"t_ns": 1, "anchor": 7, "range_m": -1.0}]}'
        yard.ask("POST", "/api/v1/ingest/samples?tag=forklift-7", content=junk, headers={"content-type": ENCODING_JSON})
        wait_until(lambda: yard.get("/api/v1/tags/forklift-7")["rejected"])
        shown = status(yard.url)
        assert (shown.returncode, shown.stderr) == (0, "")
        lines = shown.stdout.splitlines()
        assert lines[:2] == [
            f"{yard.url}: ready",
            next(line for line in lines if line.startswith("site default: 1 tags")),
        ]
        assert any(line.startswith("  tag forklift-7: ") and "refused" in line for line in lines)
        assert "  zone dock: 0 tags" in lines  # the tag is silent
        asked = json.loads(status(yard.url, "--json").stdout)
        assert (asked["healthy"], asked["sites"][0]["tags"][0]["tag"]) == (True, "forklift-7")
        unknown = status(yard.url, "--site", "elsewhere")
        assert (unknown.returncode, "has no site elsewhere" in unknown.stderr) == (2, True)


def test_a_service_that_is_impaired_or_starts_or_is_away_is_not_healthy(tmp_path: Path) -> None:
    (tmp_path / "zones.json").write_text("cut")
    with running_service("--data-dir", str(tmp_path)) as service:
        impaired = status(service.url)
        assert impaired.returncode == 1
        assert "  impaired: zones.json is damaged" in impaired.stdout
    with running_service("--zenoh-connect", free_endpoint(), ready=False) as service:
        waiting = status(service.url)
        assert (waiting.returncode, waiting.stdout.splitlines()[0]) == (1, f"{service.url}: not ready")
    away = status(f"http://127.0.0.1:{free_port()}")
    assert (away.returncode, "does not answer" in away.stderr) == (2, True)


def test_of_a_secured_service_of_several_sites_a_key_shows_the_tags_and_no_key_the_health(tmp_path: Path) -> None:
    secured = secured_site(tmp_path / "security")
    key = ApiKeys(secured.folder.path).add("operator", Scope.READ)
    config = tmp_path / "sites.toml"
    config.write_text('[sites."north"]\n[sites."south dock"]\n')
    secured.folder.add_site("north", 9)
    secured.folder.add_site("south dock", 9)
    ca = str(secured.folder.path / "ca.pem")
    options = ("--security", str(secured.folder.path), "--config", str(config), "--zenoh-listen", secured.endpoint)
    with running_service(*options, ca=Path(ca)) as service:
        without = status(service.url, "--ca", ca)
        assert (without.returncode, without.stdout.splitlines()[0]) == (0, f"{service.url}: ready")
        assert "needs an API key: set DROPANCHOR_API_KEY" in without.stdout
        shown = status(service.url, "--ca", ca, DROPANCHOR_API_KEY=key).stdout.splitlines()
        assert shown[1:] == ["site north: 0 tags, 0 connected", "site south dock: 0 tags, 0 connected"]
        one = status(service.url, "--ca", ca, "--site", "south dock", DROPANCHOR_API_KEY=key).stdout.splitlines()
        assert one[1:] == ["site south dock: 0 tags, 0 connected"]
