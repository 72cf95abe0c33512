"""The compose file is valid, and the files that it mounts exist."""

from pathlib import Path
from typing import Any

import yaml

from dropanchor_service.cli import _parser
from support.commands import python
from support.service import ROOT

DEPLOY = ROOT / "deploy"
COMPOSE, CLUSTER = DEPLOY / "compose.yaml", DEPLOY / "compose.cluster.yaml"
MADE_BY_THE_OPERATOR = "./security"


def services(file: Path = COMPOSE) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(file.read_text())["services"]
    return found


def test_the_files_follow_the_compose_specification(tmp_path: Path) -> None:
    checked = python("-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(COMPOSE), str(CLUSTER))
    assert checked.returncode == 0, checked.stdout
    wrong = tmp_path / "compose.yaml"
    wrong.write_text(COMPOSE.read_text().replace("depends_on: [router]", "depends_upon: [router]"))
    assert python("-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(wrong)).returncode == 1


def test_every_mounted_file_exists_or_is_made_by_the_operator() -> None:
    for service in (*services().values(), *services(CLUSTER).values()):
        for source in (volume.split(":")[0] for volume in service.get("volumes", [])):
            if source.startswith("./") and not source.startswith(MADE_BY_THE_OPERATOR):
                assert (DEPLOY / source).exists(), source


def test_no_volume_hides_the_compiled_estimator_of_the_image() -> None:
    """A volume keeps that of the image with which it began. For another processor there is the data folder."""
    assert "XDG_CACHE_HOME=/var/cache " in (DEPLOY / "Dockerfile").read_text()
    for service in (*services().values(), *services(CLUSTER).values()):
        mounted = [*(volume.split(":")[1] for volume in service.get("volumes", [])), *service.get("tmpfs", [])]
        assert not any(Path("/var/cache/dropanchor").is_relative_to(place) for place in mounted)
    assert "poses:/var/lib/dropanchor" in services()["service"]["volumes"]


def test_our_containers_are_read_only_and_cannot_gain_privileges() -> None:
    for name in ("router", "service"):
        service = services()[name]
        assert service["read_only"]
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert "./security:/security:ro" in service["volumes"]


def test_the_cluster_has_three_nodes_two_api_nodes_and_no_open_port_of_ray() -> None:
    found = services(CLUSTER)
    nodes = [name for name, service in found.items() if "--join" in service.get("command", [])]
    assert (nodes, found["api"]["deploy"]["replicas"]) == (["node-1", "node-2", "node-3"], 2)
    assert {name for name, service in found.items() if "ports" in service} == {"router", "api"}
    for name in (*nodes, "head", "api", "router"):
        assert found[name]["cap_drop"] == ["ALL"]
        words = found[name]["command"]
        _parser(words[:1]).parse_args(words)
    for name in nodes:
        environment = found[name]["environment"]
        assert (environment["DROPANCHOR_CLUSTER__NAME"], environment["DROPANCHOR_CLUSTER__ADDRESS"]) == (
            name,
            f"http://{name}",
        )
