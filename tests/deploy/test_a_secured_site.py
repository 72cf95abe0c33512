"""The steps of the operator's page and the commands of the compose file make a secured site with two tags."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from support.commands import python
from support.service import ROOT, Running, running_router, running_service
from support.zenoh_router import free_port, wait_until

DEPLOY = ROOT / "deploy"
TAGS = ("forklift-1", "forklift-2")


def steps() -> list[list[str]]:
    """Return the commands that the page runs in the container `admin`, in order."""
    lines = (DEPLOY / "README.md").read_text().splitlines()
    prefix = "docker compose run --rm "
    words = [
        shlex.split(line.partition(prefix)[2].partition(">")[0].partition("|")[0]) for line in lines if prefix in line
    ]
    return [line[line.index("admin") + 1 :] for line in words]


def compose_command(service: str, replaced: dict[str, str]) -> list[str]:
    """Return the command of a service in the compose file, with its paths and addresses replaced."""
    words: list[str] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())["services"][service]["command"]
    for old, new in replaced.items():
        words = [word.replace(old, new) for word in words]
    return words


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Running, Path, dict[str, str]]]:
    """Start a router and a service as the compose file does, on loopback.

    Yield the service, the folder of the credentials, and the API keys by name.
    """
    folder = tmp_path_factory.mktemp("site")
    keys = {}
    for words in steps():
        done = python("-m", "dropanchor_service", *words, "--security", str(folder / "security"))
        assert done.returncode == 0, done.stderr
        if words[0] == "key":
            keys[words[2]] = done.stdout.strip()
    port = free_port()
    replaced = {
        "/security": str(folder / "security"),
        "/etc/dropanchor.toml": str(DEPLOY / "dropanchor.toml"),
        "tls/router:7447": f"tls/localhost:{port}",
        "0.0.0.0": "127.0.0.1",
        "/var/lib/dropanchor": str(folder / "data"),
    }
    _, *router_options = compose_command("router", replaced)
    subcommand, *options = compose_command("service", replaced)
    with (
        running_router(*router_options, "--zenoh-listen", f"tls/127.0.0.1:{port}"),
        running_service(*options, subcommand=subcommand, ca=folder / "security" / "ca.pem") as service,
    ):
        service.zenoh = f"tls/localhost:{port}"
        yield service, folder / "security", keys


def test_the_page_makes_two_tags_and_keys_for_the_map_and_prometheus() -> None:
    commands = steps()
    assert commands[0][:2] == ["security", "init"]
    assert [words[2:] for words in commands if words[:2] == ["tag", "add"]] == [list(TAGS)]
    assert [words[2] for words in commands if words[:2] == ["key", "add"]] == ["dashboard", "prometheus"]


def test_two_tags_publish_and_only_a_client_with_the_key_sees_them(site: tuple[Running, Path, dict[str, str]]) -> None:
    service, security, keys = site
    for index, tag in enumerate(TAGS):
        published = python(
            *("-m", "dropanchor_tag_client", "publish", "--tag", tag, "--connect", service.zenoh),
            *("--credentials", str(security / "tags" / tag)),
            text_input="".join(f'{{"anchor": 1, "range_m": {12.0 + index}}}\n' for _ in range(20)),
        )
        assert published.returncode == 0, published.stderr
    wait_until(lambda: tags_with_ranges(service, keys["dashboard"]) == set(TAGS))
    assert ask(service, "/api/v1/poses").status_code == 401


def test_prometheus_reads_the_metrics_with_its_key_and_no_client_reads_them_without(
    site: tuple[Running, Path, dict[str, str]],
) -> None:
    service, _, keys = site
    scrape = yaml.safe_load((DEPLOY / "prometheus" / "prometheus.yml").read_text())["scrape_configs"][0]
    path = scrape.get("metrics_path", "/metrics")
    assert scrape["scheme"] == "https"
    assert "dropanchor_tags_registered 2.0" in ask(service, path, keys["prometheus"]).text
    assert ask(service, path).status_code == 401


def tags_with_ranges(service: Running, key: str) -> set[str]:
    listed: Any = ask(service, "/api/v1/tags", key).json()
    return {tag["tag"] for tag in listed["tags"] if tag["samples"].get("range")}


def ask(service: Running, path: str, key: str | None = None) -> httpx.Response:
    return service.ask("GET", path, headers={"authorization": f"Bearer {key}"} if key else {})
