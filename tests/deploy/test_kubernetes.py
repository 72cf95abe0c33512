"""The manifests fit Kubernetes' own schemas and KubeRay, and the commands and settings in them exist."""

import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import jsonschema
import kubernetes_validate
import pytest
import yaml

from dropanchor_service.cli import _parser, main
from dropanchor_service.node.app import TARGETS
from dropanchor_service.node.links import trusted
from dropanchor_service.security.api_keys import FILE, api_keys_of
from dropanchor_service.security.credentials import credentials_of, keys_and_tokens_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import Settings, ZenohSettings
from dropanchor_service.settings.sources import load_settings
from dropanchor_service.shards.actor import CONFIG
from dropanchor_service.shards.ray_node import ray_settings
from dropanchor_service.zenoh_io.session import open_session
from support.service import ROOT, running_router
from support.zenoh_router import free_port

FOLDER = ROOT / "deploy" / "kubernetes"
PROMETHEUS = ROOT / "deploy" / "prometheus" / "cluster.yml"
KUBERNETES = "1.31"
README = ROOT / "deploy" / "README.md"
NEEDS = {
    "router": {"ca.pem", "issued.json", "router.pem", "router.key"},
    "head": {"ca.pem", "issued.json", "service.pem", "service.key", FILE},
    "worker": {"ca.pem", "issued.json", "service.pem", "service.key", FILE},
    "api": {"ca.pem", "issued.json", FILE},
}
"""What each pod has of the credentials, and no more: above all nobody has the key of the authority."""
_TEXT, _WHOLE = {"type": "string", "minLength": 1}, {"type": "integer", "minimum": 0}
_GROUP = {"rayStartParams": {"type": "object", "additionalProperties": {"type": "string"}}, "template": {}}


def _object(required: list[str], **fields: Any) -> dict[str, Any]:
    return {"type": "object", "required": required, "additionalProperties": False, "properties": fields}


RAY_CLUSTER = _object(
    ["rayVersion", "authOptions", "headGroupSpec", "workerGroupSpecs"],
    rayVersion=_TEXT,
    authOptions=_object(["mode", "secretName"], mode={"const": "token"}, secretName=_TEXT),
    headGroupSpec=_object(["rayStartParams", "template"], **_GROUP),
    workerGroupSpecs={
        "type": "array",
        "minItems": 1,
        "items": _object(
            ["groupName", "replicas", "minReplicas", "maxReplicas", "rayStartParams", "template"],
            groupName=_TEXT,
            replicas=_WHOLE,
            minReplicas=_WHOLE,
            maxReplicas=_WHOLE,
            **_GROUP,
        ),
    },
)
"""What we use of `spec` in ray.io/v1 RayCluster, as the definition of the KubeRay operator (Apache-2.0) names it."""


@cache
def manifests() -> list[dict[str, Any]]:
    kustomization = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
    texts = [(FOLDER / name).read_text() for name in kustomization["resources"]]
    return [manifest for text in texts for manifest in yaml.safe_load_all(text)]


def of_kind(kind: str) -> list[dict[str, Any]]:
    return [manifest for manifest in manifests() if manifest["kind"] == kind]


def templates() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the template of every pod."""
    for manifest in [*of_kind("Deployment"), *of_kind("StatefulSet")]:
        yield manifest["metadata"]["name"], manifest["spec"]["template"]
    for manifest in of_kind("RayCluster"):
        spec = manifest["spec"]
        for role, group in (("head", spec["headGroupSpec"]), *(("worker", one) for one in spec["workerGroupSpecs"])):
            labels = {"ray.io/cluster": manifest["metadata"]["name"], "ray.io/node-type": role}  # KubeRay sets them
            yield role, {"metadata": {"labels": labels}, **group["template"]}


def containers() -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield every container with the spec of its pod."""
    for _, template in templates():
        spec = template["spec"]
        for container in (*spec.get("initContainers", ()), *spec["containers"]):
            yield container, spec


def pods() -> list[dict[str, Any]]:
    return [
        {
            "apiVersion": "v1",
            "kind": "Pod",
            "metadata": {"name": name, **template["metadata"]},
            "spec": template["spec"],
        }
        for name, template in templates()
    ]


def given() -> dict[str, dict[str, str]]:
    """Return the secrets that the operator makes, as the page says: secret → key → file of the credentials or text."""
    text = README.read_text().replace("\\\n", "")
    found = {}
    for line in re.findall(r"kubectl -n dropanchor create secret generic (.*)", text):
        name, *options = shlex.split(line)
        pairs = [option.partition("=")[2] for option in options]
        found[name] = {Path(one.partition("=")[0]).name: one for one in pairs}
    return found


def credentials_of_pod(spec: dict[str, Any]) -> dict[str, str]:
    """Return what a pod finds below /security: path → file of the credentials."""
    (volume,) = (one["secret"] for one in spec["volumes"] if one["name"] == "security")
    files = given()[volume["secretName"]]
    items = volume.get("items", [{"key": key, "path": key} for key in files])
    return {item["path"]: files[item["key"]] for item in items}


def environment_of(container: dict[str, Any]) -> dict[str, str]:
    return {one["name"]: one.get("value", "") for one in container.get("env", ())}


def test_every_manifest_and_every_pod_follows_the_schemas() -> None:
    kinds = [manifest["kind"] for manifest in manifests()]
    assert {"Namespace", "StatefulSet", "RayCluster", "Deployment", "NetworkPolicy", "PodDisruptionBudget"} <= set(
        kinds
    )
    for manifest in [*manifests(), *pods()]:
        if manifest["kind"] == "RayCluster":
            assert manifest["apiVersion"] == "ray.io/v1"
            jsonschema.validate(manifest["spec"], RAY_CLUSTER)
        else:
            kubernetes_validate.validate(manifest, KUBERNETES, strict=True)
    wrong = of_kind("Deployment")[0] | {"spec": {**of_kind("Deployment")[0]["spec"], "replica": 2}}
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(wrong, KUBERNETES, strict=True)


def test_the_settings_and_every_command_are_ours() -> None:
    settings = tomllib.loads((FOLDER / "yards.toml").read_text())
    settings["cluster"]["url"] = "postgresql://db/dropanchor"
    assert Settings.model_validate(settings).cluster.node_secret is not None
    asked = []
    for container, _ in containers():
        words = [*container.get("command", ["dropanchor"]), *container.get("args", ())]
        if words[0] == "dropanchor" and len(words) > 1:
            asked.append(words[1:])
        for word in container.get("lifecycle", {}).get("preStop", {}).get("exec", {}).get("command", ()):
            asked += [shlex.split(word)[1:]] if word.startswith("dropanchor ") else []
    assert {tuple(words[:2]) for words in asked} >= {("cluster", "supervise"), ("cluster", "drain")}
    for words in asked:
        _parser(words[:1]).parse_args(words)


def test_pods_get_what_a_node_of_a_cluster_reads() -> None:
    wanted = {name: value for name, value in ray_settings(FOLDER).items() if not name.startswith("RAY_AUTH_")}
    of_ray = [container for container, _ in containers() if container["name"].startswith("ray-")]
    assert len(of_ray) == 2
    for container in of_ray:
        environment = environment_of(container)
        assert environment.items() >= wanted.items()  # the operator sets the token
        assert environment[CONFIG] == "/etc/dropanchor/yards.toml"
        assert environment["DROPANCHOR_CLUSTER__ADDRESS"] == "http://$(POD_IP)"
    for group in of_kind("RayCluster")[0]["spec"]["workerGroupSpecs"]:
        assert json.loads(json.loads(group["rayStartParams"]["resources"].strip("'"))) == {"shard": 2}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the credentials of a site."""
    folder = tmp_path_factory.mktemp("site") / "security"
    assert main(["security", "init", "--security", str(folder), "--site", "017.yard"]) == 0
    assert main(["key", "add", "prometheus", "--security", str(folder)]) == 0
    return folder


@pytest.mark.parametrize("pod", NEEDS)
def test_a_pod_has_the_credentials_that_it_needs_and_nobody_has_the_key_of_the_authority(
    pod: str, made: Path, tmp_path: Path
) -> None:
    found = credentials_of_pod(dict(templates())[pod]["spec"])
    assert found.keys() == NEEDS[pod]
    for path, file in found.items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_bytes((made / file).read_bytes())
    port = free_port()
    settings = load_settings(FOLDER / "yards.toml", {"security": {"folder": str(tmp_path)}}, environment={})
    opened = credentials_of(settings.model_copy(update={"sites": {}}))
    assert opened is not None
    if pod == "router":
        with running_router("--security", str(tmp_path), "--zenoh-listen", f"tls/127.0.0.1:{port}"):
            return
    authenticator = keys_and_tokens_of(settings)
    assert authenticator is not None
    (key,) = api_keys_of(authenticator).all().values()  # type: ignore[union-attr]
    assert key.name == "prometheus"
    if "service.key" in found:
        whole = SecurityFolder.open(made)
        with open_session(ZenohSettings(listen=(f"tls/127.0.0.1:{port}",)), whole):
            open_session(ZenohSettings(connect=(f"tls/localhost:{port}",)), opened).close()
    else:
        assert trusted(opened.certificate("ca"))


def test_every_mounted_secret_is_one_that_the_operator_makes() -> None:
    for container, spec in containers():
        volumes = {volume["name"]: volume for volume in spec["volumes"]}
        for mount in container["volumeMounts"]:
            volume = volumes[mount["name"]]
            assert volume.get("secret", {}).get("secretName", "node") in given()
            assert mount.get("readOnly") or not {"secret", "configMap"} & volume.keys()
        for variable in container.get("env", ()):
            reference = variable.get("valueFrom", {}).get("secretKeyRef", {"name": "node", "key": "secret"})
            assert reference["key"] in given()[reference["name"]]


def test_containers_run_without_privileges_and_with_limits_and_probes() -> None:
    for container, spec in containers():
        assert spec["securityContext"]["runAsNonRoot"]
        assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
        assert not spec["automountServiceAccountToken"]
        assert container["securityContext"]["capabilities"] == {"drop": ["ALL"]}
        assert not container["securityContext"]["allowPrivilegeEscalation"]
        if container in spec["containers"]:
            assert "memory" in container["resources"]["limits"]
    for name, template in templates():
        first = template["spec"]["containers"][0]
        assert {"startupProbe", "livenessProbe", "readinessProbe"} <= first.keys(), name


def test_only_shards_reach_rays_ports_and_budgets_and_services_select_pods() -> None:
    labels = [template["metadata"]["labels"] for _, template in templates()]
    policies = {policy["metadata"]["name"]: policy["spec"] for policy in of_kind("NetworkPolicy")}
    assert policies["nobody"] == {"podSelector": {}, "policyTypes": ["Ingress"]}
    (others,) = (rule for rule in policies["shards"]["ingress"] if "ports" in rule)
    assert others["ports"] == [{"port": 32768, "endPort": 60999}]
    for group in (
        of_kind("RayCluster")[0]["spec"]["headGroupSpec"],
        *of_kind("RayCluster")[0]["spec"]["workerGroupSpecs"],
    ):
        ports = [int(value) for name, value in group["rayStartParams"].items() if name.endswith("-port")]
        assert len(ports) == 8
        assert max(ports) < 32768
    selectors = [spec["podSelector"].get("matchLabels", {}) for spec in policies.values()]
    selectors += [budget["spec"]["selector"]["matchLabels"] for budget in of_kind("PodDisruptionBudget")]
    selectors += [service["spec"]["selector"] for service in of_kind("Service")]
    assert len(of_kind("PodDisruptionBudget")) == 3
    for selector in selectors:
        assert any(selector.items() <= one.items() for one in labels), selector


def test_prometheus_reaches_the_shards_and_the_api_nodes_that_its_settings_name() -> None:
    settings = tomllib.loads((FOLDER / "yards.toml").read_text())
    policies = {policy["metadata"]["name"]: policy["spec"] for policy in of_kind("NetworkPolicy")}
    pods = {name: template["metadata"] for name, template in templates()}
    shards, nodes = yaml.safe_load(PROMETHEUS.read_text())["scrape_configs"]
    (discovery,) = shards["http_sd_configs"]
    url = urlsplit(discovery["url"])
    assert discovery["authorization"]["type"] == "Bearer"
    (service,) = of_kind("Service")[1:]
    assert url.hostname == f"{service['metadata']['name']}.dropanchor.svc"
    assert url.hostname in settings["http"]["allowed_hosts"]
    assert (url.port or 80, url.path) == (service["spec"]["ports"][0]["port"], TARGETS)
    (rule,) = (one for one in policies["shards"]["ingress"] if "ports" in one)
    assert {"namespaceSelector": {"matchLabels": {"kubernetes.io/metadata.name": "monitoring"}}} in rule["from"]
    assert "the namespace `monitoring`" in PROMETHEUS.read_text()
    assert nodes["kubernetes_sd_configs"] == [{"role": "pod", "namespaces": {"names": ["dropanchor"]}}]
    scraped = {
        name: pod["annotations"] for name, pod in pods.items() if "prometheus.io/scrape" in pod.get("annotations", {})
    }
    assert scraped.keys() == {"api"}
    port = int(scraped["api"]["prometheus.io/port"])
    assert policies["api"]["ingress"] == [{"ports": [{"port": port}]}]  # from everybody
    assert {"alerts.yml"} == set(yaml.safe_load(PROMETHEUS.read_text())["rule_files"])
    assert shards["job_name"] == "dropanchor"  # which alerts ask for
