"""The compose file is valid, and the files that it mounts exist."""

from pathlib import Path
from typing import Any

import yaml

from support.commands import python
from support.service import ROOT

DEPLOY = ROOT / "deploy"
COMPOSE = DEPLOY / "compose.yaml"
MADE_BY_THE_OPERATOR = "./security"


def services() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(COMPOSE.read_text())["services"]
    return found


def test_the_file_follows_the_compose_specification(tmp_path: Path) -> None:
    checked = python("-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(COMPOSE))
    assert checked.returncode == 0, checked.stdout
    wrong = tmp_path / "compose.yaml"
    wrong.write_text(COMPOSE.read_text().replace("depends_on: [router]", "depends_upon: [router]"))
    assert python("-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(wrong)).returncode == 1


def test_every_mounted_file_exists_or_is_made_by_the_operator() -> None:
    for service in services().values():
        for source in (volume.split(":")[0] for volume in service.get("volumes", [])):
            if source.startswith("./") and not source.startswith(MADE_BY_THE_OPERATOR):
                assert (DEPLOY / source).exists(), source


def test_the_kernel_cache_lies_where_the_service_can_write() -> None:
    mounted = {volume.split(":")[1] for volume in services()["service"]["volumes"]}
    assert "XDG_CACHE_HOME=/var/cache " in (DEPLOY / "Dockerfile").read_text()
    assert {"/var/cache/dropanchor", "/var/lib/dropanchor"} <= mounted


def test_our_containers_are_read_only_and_cannot_gain_privileges() -> None:
    for name in ("router", "service"):
        service = services()[name]
        assert service["read_only"]
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert "./security:/security:ro" in service["volumes"]
