"""Simulated runs through the engines."""

from dataclasses import replace

import numpy as np
import pytest

from dropanchor_evaluation.paper.estimators import PaperEstimator
from dropanchor_evaluation.simulated import Feed, PriorKnowledge, run_engine
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate


@pytest.fixture(scope="module")
def lines() -> list[Simulation]:
    return [simulate("L1", seed, preset("real")) for seed in (3, 4)]


def test_the_engine_paper_behind_the_adapter_gives_the_numbers_of_the_compiled_algorithm() -> None:
    runs = [simulate("L1", 3, preset("paper"))]
    parameters = replace(TUNED, range_std=0.2, heading_std=0.1)  # what the samples say of themselves
    (one,) = run_engine(PaperEngine(parameters), runs, PriorKnowledge("heading", heading_std=0.1)).tracks
    (other,) = PaperEstimator(parameters, speed_estimator=True).run(runs, PriorKnowledge()).tracks
    assert one.t.tolist() == pytest.approx(other.t.tolist())
    for name in ("x", "y", "speed"):
        np.testing.assert_allclose(one.poses[name], other.poses[name], atol=1e-5)
    np.testing.assert_allclose(one.poses["cov"][:, :2, :2], other.poses["cov"][:, :2, :2], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("feed", ["level", "raw"])
def test_runs_in_one_engine_do_not_affect_each_other(lines: list[Simulation], feed: Feed) -> None:
    known = PriorKnowledge(feed, heading_std=0.05)
    together = run_engine(FleetEngine(), lines, known).tracks
    alone = [run_engine(FleetEngine(), [one], known).tracks[0] for one in lines]
    for one, other in zip(together, alone, strict=True):
        assert len(one.poses) > 300
        np.testing.assert_array_equal(one.poses["x"], other.poses["x"])


def test_without_a_start_the_paper_has_no_position_and_with_one_it_begins_there(lines: list[Simulation]) -> None:
    (unknown, _) = run_engine(PaperEngine(TUNED), lines, PriorKnowledge("heading", start=False)).tracks
    (known, _) = run_engine(PaperEngine(TUNED), lines, PriorKnowledge("heading")).tracks
    assert np.isnan(unknown.poses["x"]).all()
    assert known.poses["x"][0] == pytest.approx(10.0, abs=0.3)
    assert known.poses["y"][0] == pytest.approx(0.0, abs=0.3)
