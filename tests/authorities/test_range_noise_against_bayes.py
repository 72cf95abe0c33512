"""The levels of lasting range errors against Bayes' theorem over a grid, in plain NumPy."""

import numpy as np
import pytest
from scipy.stats import norm

from dropanchor_service.estimation.fleet.belief.layout import NOISE_LEVELS, ROW
from dropanchor_service.estimation.fleet.belief.range_noise import learn_lasting, learn_white
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.tuning import Tuning

DT, PER_BLOCK = 0.1, 20
LEVELS = np.arange(NOISE_LEVELS)


def by_bayes(blocks: np.ndarray, white: float, track: float, t: Tuning) -> float:
    """Return the mean factor after blocks of innovations, each judged by its sum alone."""
    prior = np.exp(t.noise_log_prior * LEVELS)
    p = prior / prior.sum()
    for block in blocks:
        variance = PER_BLOCK * (track + 4.0**LEVELS * white)
        kept = np.exp(-PER_BLOCK * DT / t.noise_memory_s)
        p = p**kept * prior ** (1.0 - kept) * norm.pdf(block.sum(), 0.0, np.sqrt(variance))
        p /= p.sum()
    return float(p @ 4.0**LEVELS)


@pytest.mark.parametrize("std", [0.1, 0.4, 1.5])
def test_the_factor_is_the_mean_of_the_posterior(std: float) -> None:
    t, rng = Tuning(), np.random.default_rng(5)
    row, work = np.zeros(1, ROW)[0], make_workspace()[0]["hypotheses"]
    row["settings"]["range_std"] = 0.15
    node = np.zeros(1, NODE)[0]
    node["t_ns"], node["z"], node["z_std"] = 1, 20.0, np.nan
    learn_white(row, node, t.record()[0])
    white, track = row["noise"]["white_var"], 0.01
    blocks = np.repeat(rng.normal(0.0, std, (6, 1)), PER_BLOCK, axis=1)
    for e in blocks.ravel():
        used = 100.0  # wide, so that nothing is clipped
        learn_lasting(work, 0, row, e, used + track, used, DT, t.record()[0])
    assert row["noise"]["factor"] == pytest.approx(by_bayes(blocks, white, track, t), rel=1e-9)
