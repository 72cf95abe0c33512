"""Both engines use the operator's calibration in the same way: measured = scale · distance + bias."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from dropanchor_service.estimation.columns import HEADING, RANGE, Array, SampleBatch, anchors_at, default_settings
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from dropanchor_service.estimation.protocols import Engine

SCALE, BIAS, RANGE_STD = 1.069, 0.3, 0.1
ANCHORS = anchors_at((0.0, 0.0, 0.0), (4.0, 3.0, 2.0))
START = (10.0, 0.0, 1.2)
ENGINES: dict[str, Callable[[], Engine]] = {"fleet": FleetEngine, "paper": lambda: PaperEngine(TUNED)}


def innovations(engine: Engine, anchor: int) -> Array:
    """Return INNOVATION of exact ranges to one anchor, of a tag at rest whose start and calibration are known."""
    settings = default_settings()
    settings["range_scale"], settings["range_bias"], settings["range_bias_std"] = SCALE, BIAS, 0.0
    settings["range_std"], settings["mount_angle"] = RANGE_STD, 0.0
    settings["start_known"], settings["start_std"] = True, 0.001
    settings["start_x"], settings["start_y"], settings["height"] = START
    engine.set_anchors(ANCHORS)
    engine.configure(0, settings)
    t_ns = np.arange(0, 1_000_000_000, 100_000_000)
    headings, ranges = np.zeros(len(t_ns), HEADING), np.zeros(len(t_ns) - 1, RANGE)
    headings["t_ns"], headings["std"] = t_ns, 0.05
    ranges["t_ns"], ranges["anchor"], ranges["std"] = t_ns[1:], [0] + [anchor] * (len(t_ns) - 2), math.nan
    distances = [math.dist(START, ANCHORS[index].tolist()[:3]) for index in ranges["anchor"]]
    ranges["range"] = SCALE * np.array(distances) + BIAS
    return engine.process(SampleBatch(headings=headings, ranges=ranges)).innovations


@pytest.mark.parametrize("anchor", [0, 1])
@pytest.mark.parametrize("name", ENGINES)
def test_an_exact_range_has_no_innovation(name: str, anchor: int) -> None:
    records = innovations(ENGINES[name](), anchor)
    own = records[records["anchor"] == anchor][:3]
    assert len(own) == 3
    np.testing.assert_allclose(own["innovation"], 0.0, atol=5e-3)
    np.testing.assert_allclose(own["predicted"], own["measured"], atol=5e-3)


@pytest.mark.parametrize("name", ENGINES)
def test_the_noise_of_a_range_is_that_of_what_is_measured(name: str) -> None:
    first = innovations(ENGINES[name](), 0)[0]
    assert math.sqrt(first["S"]) == pytest.approx(RANGE_STD, rel=0.15)
    assert math.sqrt(first["S"]) >= RANGE_STD
