"""The kernels of the zones are compiled before the first pose."""

import sys

from numba.core.dispatcher import Dispatcher

from dropanchor_schemas.zones import TooCloseRule
from dropanchor_service.engines.warm_up import warm_up_zones
from support.events import EventBench, circle


def signatures() -> dict[str, int]:
    """Return the number of compiled signatures of each kernel of the zones."""
    modules = [module for name, module in sys.modules.items() if name.startswith("dropanchor_service.zones")]
    kernels = {(name, id(value)): value for module in modules for name, value in vars(module).items()}
    return {name: len(value.signatures) for (name, _), value in kernels.items() if isinstance(value, Dispatcher)}


def test_nothing_is_compiled_when_tags_move() -> None:
    warm_up_zones()
    before = signatures()
    assert {"judge", "p_inside", "close_pairs", "p_close"} <= before.keys()
    bench = EventBench()
    bench.put(circle(speed_mps=1.0), rules=[TooCloseRule(id="apart", type="too_close", distance_m=9.0)])
    bench.ambiguous(2.0, "c", [(0.5, 0.0, 0.0), (0.5, 9.0, 0.0)])
    bench.stay(3.0, "a", "b", x=0.0, speed=2.0)
    bench.put(circle(speed_mps=1.0), circle("other"))
    bench.stay(9.0, "a", "b", x=30.0)
    assert len(bench.events()) >= 5
    assert signatures() == before
