"""The page of the births of hypotheses, from the table that the fleet engine runs."""

from dropanchor_evaluation.reference.markdown import table
from dropanchor_service.estimation.fleet.belief.births.birth import Birth
from dropanchor_service.estimation.fleet.belief.births.table import BIRTHS

_INTRODUCTION = """\
# Births of hypotheses

The [fleet engine](../explanation/fleet-engine.md) keeps a mixture of hypotheses for each tag. Here is where one is
born or changes in kind. Births of one moment run together, in this order. A source that is lighter than the best
hypothesis by more than its depth gets no child, and so does one whose children find no room.

Names like `nlos_run` are numbers of `Tuning`. Each birth can be switched off, to see what it buys:

```python
from dropanchor_service.estimation.fleet.belief.births.table import without
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.tuning import Tuning

engine = FleetEngine(Tuning(births=without("turned-after-stop", "pushed-back")))
```
"""
_HEADER = (
    "birth",
    "when",
    "guard",
    "from",
    "to",
    "log prior",
    "what else changes",
    "at most every",
    "depth",
    "needed by",
)


def _line(birth: Birth) -> tuple[str, ...]:
    needed = (birth.needed_by + (f" (decision {birth.decision})" if birth.decision else "")).replace("*", "\\*")
    name = f"`{birth.name}`"
    kind = (birth.source, birth.target, birth.prior)
    return name, birth.when, birth.guard, *kind, birth.changes, birth.period, birth.depth, needed


def page() -> str:
    """Return the page as Markdown."""
    return f"{_INTRODUCTION}\n{table(_HEADER, map(_line, BIRTHS))}"
