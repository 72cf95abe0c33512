"""What a service writes, it may write in each of the deployments, and what it only reads it may not."""

import shlex
import tomllib
from collections.abc import Mapping
from configparser import ConfigParser
from pathlib import PurePosixPath
from typing import NamedTuple

import pytest
import yaml

from dropanchor_service.cli import _parser
from dropanchor_service.security.api_keys import FOLDER as KEYS
from support.service import ROOT

DEPLOY = ROOT / "deploy"
CLUSTER = tomllib.loads((DEPLOY / "kubernetes" / "yards.toml").read_text())


class Place(NamedTuple):
    """A process of ours: where it writes and what it keeps secret, and which paths its deployment lets it write."""

    data: str
    security: str
    makes_keys: bool
    writable: Mapping[str, bool]

    def may_write(self, path: str) -> bool:
        """Return whether a path can be written: the innermost mount that has it decides."""
        found = [
            self.writable[str(one)]
            for one in (PurePosixPath(path), *PurePosixPath(path).parents)
            if str(one) in self.writable
        ]
        return found[0]


def options(words: list[str]) -> tuple[str, str]:
    """Return the data folder and the folder of credentials that a command names."""
    parsed = _parser(words[:1]).parse_args(words)
    return str(parsed.data_dir), str(parsed.security)


def of_compose(file: str, name: str) -> Place:
    service = yaml.safe_load((DEPLOY / file).read_text())["services"][name]
    mounts = {volume.split(":")[1]: not volume.endswith(":ro") for volume in service["volumes"]}
    writable = {"/": not service.get("read_only", False), **dict.fromkeys(service.get("tmpfs", ()), True), **mounts}
    if service["command"][0] == "serve":
        return Place(*options(service["command"]), True, writable)
    return Place(CLUSTER["data_dir"], CLUSTER["security"]["folder"], False, writable)


def of_systemd() -> Place:
    unit = ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read_string((DEPLOY / "systemd" / "dropanchor.service").read_text())
    found = unit["Service"]
    writable = {"/": found["ProtectSystem"] != "strict"}
    writable |= dict.fromkeys((path.lstrip("-") for path in found["ReadWritePaths"].split()), True)
    writable[f"/var/lib/{found['StateDirectory']}"] = writable[f"/var/cache/{found['CacheDirectory']}"] = True
    return Place(*options(shlex.split(found["ExecStart"])[1:]), True, writable)


def of_kubernetes() -> Place:
    """Return a shard. Several have the same keys, so none of them makes any."""
    cluster = next(yaml.safe_load_all((DEPLOY / "kubernetes" / "shards.yaml").read_text()))
    (worker,) = cluster["spec"]["workerGroupSpecs"][0]["template"]["spec"]["containers"]
    mounts = {mount["mountPath"]: not mount.get("readOnly", False) for mount in worker["volumeMounts"]}
    return Place(CLUSTER["data_dir"], CLUSTER["security"]["folder"], False, {"/": True, **mounts})


PLACES = {
    "compose": of_compose("compose.yaml", "service"),
    "systemd": of_systemd(),
    "Kubernetes": of_kubernetes(),
    **{name: of_compose("compose.cluster.yaml", name) for name in ("head", "node-1", "node-2", "node-3")},
}


@pytest.mark.parametrize("name", PLACES)
def test_a_service_may_write_its_data_and_the_keys_that_it_makes_and_no_certificate(name: str) -> None:
    place = PLACES[name]
    assert place.may_write(place.data)
    assert place.may_write(f"{place.security}/{KEYS}") == place.makes_keys
    assert not place.may_write(f"{place.security}/service.key")
