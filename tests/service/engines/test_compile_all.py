"""The belief and the front-end of the estimator compile apart from each other, and just as the engine uses them."""

import json

from support.commands import python

PROGRAM = """
import json
from dropanchor_service.engines.warm_up import warm_up, warm_up_belief, warm_up_front_end
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.assembly import assemble_nodes

def compiled():
    return len(advance.signatures), len(assemble_nodes.signatures)

warm_up_front_end()
found = [compiled()]
warm_up_belief()
found.append(compiled())
warm_up(FleetEngine())
print(json.dumps([*found, compiled()]))
"""


def test_each_part_compiles_alone_and_the_engine_needs_no_other_version() -> None:
    ended = python("-c", PROGRAM)
    assert json.loads(ended.stdout) == [[0, 1], [1, 1], [1, 1]], ended.stderr
