"""The Grafana board and the alert rules query only metrics and labels that the service exposes."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from typing import Any

import promql_parser as promql
import pytest
import yaml
from prometheus_client import CollectorRegistry, Metric, generate_latest
from prometheus_client.parser import text_string_to_metric_families

from dropanchor_service.api.help.rendering import page
from dropanchor_service.metrics.cluster import ClusterGauges
from dropanchor_service.metrics.node import LeaseGauges
from support.service import ROOT, running_service

DEPLOY = ROOT / "deploy"
BOARD = DEPLOY / "grafana" / "dashboards" / "dropanchor.json"
RUNBOOK = ROOT / "service" / "docs" / "how-to" / "answer-alerts.md"
ALERTS = DEPLOY / "prometheus" / "alerts.yml"
MADE_BY_PROMETHEUS = {"up": {"job", "instance"}}
ADDED_BY_PROMETHEUS = {"job", "instance"}


def board() -> Any:
    return json.loads(BOARD.read_text())


def rules() -> list[Any]:
    return [rule for group in yaml.safe_load(ALERTS.read_text())["groups"] for rule in group["rules"]]


def expressions() -> list[str]:
    return [target["expr"] for panel in board()["panels"] for target in panel["targets"]] + [r["expr"] for r in rules()]


@pytest.fixture(scope="module")
def families(tmp_path_factory: pytest.TempPathFactory) -> list[Metric]:
    """Return what a service exposes that nothing has happened to, and one in a cluster."""
    folder = tmp_path_factory.mktemp("data")
    with running_service("--engine", "paper", "--data-dir", str(folder)) as service:
        text = service.ask("GET", "/metrics").text
    of_cluster = CollectorRegistry()
    of_cluster.register(ClusterGauges("yard", lambda: (1, 0.0)))
    of_cluster.register(LeaseGauges(lambda: ["yard"], list, lambda: 0.0))
    text += generate_latest(of_cluster).decode()
    return list(text_string_to_metric_families(text))


@pytest.fixture(scope="module")
def exposed(families: list[Metric]) -> dict[str, dict[str, set[str]]]:
    """Return the values of labels: metric → label → values."""
    found: dict[str, dict[str, set[str]]] = {}
    for family in families:
        for sample in family.samples:
            labels = found.setdefault(sample.name, {})
            for label, value in sample.labels.items():
                labels.setdefault(label, set()).add(value)
        # A counter with labels has no sample before its first count.
        found.setdefault(f"{family.name}_total" if family.type == "counter" else family.name, {})
    return found


@pytest.mark.parametrize("expression", expressions())
def test_every_metric_and_label_in_an_expression_exists(
    expression: str, exposed: dict[str, dict[str, set[str]]]
) -> None:
    for selector in selectors(promql.parse(expression)):
        if selector.name in MADE_BY_PROMETHEUS:
            continue
        assert selector.name in exposed
        for matcher in selector.matchers.matchers:
            if matcher.name in ADDED_BY_PROMETHEUS:
                continue
            values = exposed[selector.name][matcher.name]
            assert set(re.split(r"\|", matcher.value)) <= values
    names = [selector.name for selector in selectors(promql.parse(expression))]
    for label in re.findall(r"\bby \((\w+)\)", expression):
        assert label in {known for name in names for known in exposed[name]}


@pytest.mark.parametrize("rule", rules(), ids=lambda rule: rule["alert"])
def test_the_counters_of_an_alert_begin_at_zero_so_that_their_first_count_is_an_increase(
    rule: Any, families: list[Metric]
) -> None:
    for selector in selectors(promql.parse(rule["expr"])):
        if selector.name.endswith(("_total", "_bucket")):
            values = [one.value for family in families for one in family.samples if one.name == selector.name]
            assert values, f"{selector.name} has no series before its first count"
            assert set(values) == {0.0}


def test_the_check_fails_for_a_metric_that_does_not_exist(exposed: dict[str, dict[str, set[str]]]) -> None:
    with pytest.raises(AssertionError):
        test_every_metric_and_label_in_an_expression_exists("rate(dropanchor_wishes_total[1m])", exposed)
    with pytest.raises(AssertionError):
        test_every_metric_and_label_in_an_expression_exists('dropanchor_tags{state="asleep"}', exposed)


def test_the_board_shows_the_services_that_somebody_chooses() -> None:
    (variable,) = board()["templating"]["list"]
    assert variable["query"] == f"label_values(dropanchor_tags_registered, {variable['name']})"
    for panel in board()["panels"]:
        for target in panel["targets"]:
            for selector in selectors(promql.parse(target["expr"])):
                assert 'instance=~"$instance"' in [f'{one.name}=~"{one.value}"' for one in selector.matchers.matchers]


def test_every_alert_says_what_happened_and_what_to_do() -> None:
    names = [rule["alert"] for rule in rules()]
    assert len(set(names)) == len(names) >= 8
    for rule in rules():
        assert rule["labels"]["severity"] in ("critical", "warning")
        assert rule["annotations"]["summary"]
        assert rule["annotations"]["action"]


def test_every_alert_names_its_section_in_the_runbook_and_no_section_is_left_over() -> None:
    for rule in rules():
        section = f"how-to/{RUNBOOK.name}#{rule['alert'].lower()}"
        assert rule["annotations"]["runbook"] == f"{{{{ $externalLabels.service_url }}}}/help/{section}"
        assert f'id="{rule["alert"].lower()}"' in page(f"how-to/{RUNBOOK.name}")
    for file in ("prometheus.yml", "cluster.yml"):
        assert yaml.safe_load((ALERTS.parent / file).read_text())["global"]["external_labels"]["service_url"]
    sections = re.findall(r"^## (\w+)$", RUNBOOK.read_text(), re.MULTILINE)
    assert sorted(sections) == sorted(rule["alert"] for rule in rules())


def test_alertmanager_tells_receivers_that_exist_about_alerts_that_exist() -> None:
    configuration = yaml.safe_load((DEPLOY / "alertmanager" / "alertmanager.yml").read_text())
    known = {receiver["name"] for receiver in configuration["receivers"]}
    top = configuration["route"]
    assert {route["receiver"] for route in (top, *top["routes"])} <= known
    alerts, severities = {rule["alert"] for rule in rules()}, {rule["labels"]["severity"] for rule in rules()}
    matchers = [matcher for route in top["routes"] for matcher in route["matchers"]]
    for inhibition in configuration["inhibit_rules"]:
        matchers += inhibition["source_matchers"] + inhibition["target_matchers"]
    for matcher in matchers:
        found = re.fullmatch(r'(alertname|severity)=~?"([\w|]+)"', matcher)
        assert found is not None, matcher
        assert set(found[2].split("|")) <= (alerts if found[1] == "alertname" else severities)


def test_prometheus_finds_alertmanager_and_alertmanager_its_files_where_compose_runs_them() -> None:
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    prometheus = yaml.safe_load((DEPLOY / "prometheus" / "prometheus.yml").read_text())
    (target,) = prometheus["alerting"]["alertmanagers"][0]["static_configs"][0]["targets"]
    name, port = target.split(":")
    service = compose["services"][name]
    assert any(published.endswith(f":{port}") for published in service["ports"])
    assert "./alertmanager:/etc/alertmanager:ro" in service["volumes"]
    configuration = yaml.safe_load((DEPLOY / "alertmanager" / "alertmanager.yml").read_text())
    secret = configuration["global"]["smtp_auth_password_file"].removeprefix("/run/secrets/")
    assert secret in service["secrets"]
    assert secret in compose["secrets"]


@pytest.mark.parametrize(
    ("program", "arguments"),
    [
        ("promtool", ["check", "rules", "prometheus/alerts.yml"]),
        ("amtool", ["check-config", "alertmanager/alertmanager.yml"]),
    ],
)
def test_the_tools_of_prometheus_accept_the_files(program: str, arguments: list[str]) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed: the other tests here read the file without it")
    checked = subprocess.run([program, *arguments], cwd=DEPLOY, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_no_two_panels_overlap_and_all_have_a_title() -> None:
    taken: set[tuple[int, int]] = set()
    for panel in board()["panels"]:
        assert panel["title"]
        place = panel["gridPos"]
        cells = {(place["x"] + i, place["y"] + j) for i in range(place["w"]) for j in range(place["h"])}
        assert not cells & taken
        assert max(x for x, _ in cells) < 24
        taken |= cells
    assert len({panel["id"] for panel in board()["panels"]}) == len(board()["panels"])


def test_grafana_finds_the_board_and_the_data_source_where_compose_mounts_them() -> None:
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    mounts = dict(volume.split(":")[:2][::-1] for volume in compose["services"]["grafana"]["volumes"])
    provider = yaml.safe_load((DEPLOY / "grafana/provisioning/dashboards/dropanchor.yaml").read_text())["providers"][0]
    assert (DEPLOY / mounts[provider["options"]["path"]] / "dropanchor.json").is_file()
    source = yaml.safe_load((DEPLOY / "grafana/provisioning/datasources/prometheus.yaml").read_text())["datasources"][0]
    assert {panel["datasource"]["uid"] for panel in board()["panels"]} == {source["uid"]}


def selectors(node: Any) -> Iterator[Any]:
    """Yield every vector selector below a node of a parsed expression."""
    match type(node).__name__:
        case "VectorSelector":
            yield node
        case "MatrixSelector":
            yield node.vector_selector
        case "BinaryExpr":
            yield from selectors(node.lhs)
            yield from selectors(node.rhs)
        case "Call":
            for argument in node.args:
                yield from selectors(argument)
        case "AggregateExpr" | "ParenExpr" | "UnaryExpr" | "SubqueryExpr":
            yield from selectors(node.expr)
