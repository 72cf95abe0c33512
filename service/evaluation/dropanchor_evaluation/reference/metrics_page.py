"""The page of metrics, from the collectors themselves."""

from collections.abc import Iterable

from prometheus_client.core import Metric
from prometheus_client.registry import CollectorRegistry

from dropanchor_evaluation.reference.markdown import table

_INTRODUCTION = """\
# Metrics

`GET /metrics` answers in Prometheus' format. `deploy/` has alert rules and a Grafana dashboard for them. Counters end
in `_total`. No metric has a label per tag; `GET /api/v1/tags/{tag}` counts per tag.
"""


_OF_A_NODE = """\
## Of an API node

`dropanchor api` has these, and none of the above.
"""


def page(registry: CollectorRegistry, of_node: CollectorRegistry) -> str:
    """Return the page as Markdown. registry: with everything that a service registers. of_node: the same of a node."""
    return "\n".join([_INTRODUCTION, _table(registry), _OF_A_NODE, _table(of_node)])


def _table(registry: CollectorRegistry) -> str:
    families = sorted(registry.collect(), key=lambda family: family.name)
    return table(("metric", "type", "labels", "meaning"), _rows(families))


def _rows(families: Iterable[Metric]) -> Iterable[tuple[str, str, str, str]]:
    for family in families:
        if family.name.startswith("dropanchor_"):
            labels = sorted({label for sample in family.samples for label in sample.labels if label != "le"})
            name = f"{family.name}_total" if family.type == "counter" else family.name
            yield f"`{name}`", family.type, ", ".join(f"`{label}`" for label in labels), family.documentation
