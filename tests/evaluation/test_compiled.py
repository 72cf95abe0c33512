"""Algorithm 1 compiled, held to the engine."""

from dataclasses import replace

import numpy as np
import pytest

from dropanchor_evaluation.paper.compiled import algorithm1
from dropanchor_service.estimation.columns import ANCHOR, HEADING, RANGE, HeadingSource, SampleBatch, default_settings
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED, PaperParameters


@pytest.mark.parametrize(("parameters", "sigma"), [(TUNED, 0.2), (PaperParameters(), 0.005)])
def test_the_compiled_algorithm_gives_the_numbers_of_the_engine(parameters: PaperParameters, sigma: float) -> None:
    rng = np.random.default_rng(8)
    t = np.arange(1500) * 0.02
    course = np.pi / 2 + np.where(t > 12, 0.9, 0.0) - np.where(t > 22, 1.6, 0.0)
    speed = np.where(t > 1, 3.0, 0.0)
    x = 10 + np.cumsum(0.02 * speed * np.cos(course))
    y = np.cumsum(0.02 * speed * np.sin(course))
    ranges = np.where(np.arange(1500) % 2 == 0, np.hypot(x, y) + rng.normal(0, sigma, 1500), np.nan)
    heading = course + rng.normal(0, sigma / 2, 1500)
    compiled = algorithm1(t, heading, ranges, (10.0, 0.0, np.pi / 2), parameters)

    engine = PaperEngine(parameters)
    engine.set_anchors(np.zeros(1, ANCHOR))
    settings = default_settings()
    settings["start_known"], settings["start_x"], settings["start_y"] = True, 10.0, 0.0
    settings["start_heading"], settings["heading_source"] = np.pi / 2, HeadingSource.PLATFORM
    engine.configure(0, settings)
    t_ns = np.rint(t * 1e9).astype(np.int64)
    headings = np.zeros(1500, HEADING)
    headings["t_ns"], headings["heading"], headings["std"] = t_ns, heading, np.nan
    measured = np.zeros(750, RANGE)
    measured["t_ns"], measured["range"], measured["std"] = t_ns[::2], ranges[::2], np.nan
    poses = engine.process(SampleBatch(ranges=measured, headings=headings)).poses

    assert len(poses) == 750
    np.testing.assert_allclose(compiled.x[::2], poses["x"], atol=1e-6)
    np.testing.assert_allclose(compiled.v[::2], poses["speed"], atol=1e-6)
    np.testing.assert_allclose(compiled.cov[::2], poses["cov"][:, :2, :2], rtol=1e-6, atol=1e-9)


def test_without_the_speed_estimator_only_range_and_heading_move_the_speed() -> None:
    t = np.arange(400) * 0.05
    y = 4.0 * t
    parameters = replace(TUNED, gate=np.inf)
    with_it, without = (
        algorithm1(
            t, np.full(400, np.pi / 2), np.hypot(10.0, y), (10.0, 0.0, np.pi / 2), parameters, speed_estimator=on
        )
        for on in (True, False)
    )
    assert not np.allclose(with_it.v, without.v)
    assert abs(with_it.v[-1] - 4.0) < 0.1
