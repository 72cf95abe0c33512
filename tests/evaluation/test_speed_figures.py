"""Fig. 3 and Fig. 4 of the paper."""

import numpy as np
import pytest

from dropanchor_evaluation.paper import fig3, fig4
from dropanchor_tag_client.simulator.scenarios import trajectory


def test_straight_stages_give_their_speed_exactly_and_changes_give_peaks() -> None:
    found = fig3.estimated(trajectory("fig3-straight", 0))
    assert found.error[found.within].max() < 1e-9
    assert found.error[~found.within].max() > 1.0


def test_arcs_are_biased_by_v_w_b() -> None:
    short = fig3.estimated(trajectory("fig3-arcs", 0), lag_s=0.02)
    assert np.median(short.error[short.within]) > 0.5
    np.testing.assert_allclose(short.estimate[short.within], short.predicted[short.within], atol=0.02)


@pytest.mark.parametrize("estimator", [fig4.direct(100, rectify=False), fig4.least_squares(201)])
def test_noise_free_ranges_of_a_line_give_its_speed(estimator: fig4.Estimator) -> None:
    motion = trajectory("fig4", 0)
    speed = estimator(motion.t, motion.distance)
    np.testing.assert_allclose(speed[np.isfinite(speed)], 10.0, atol=1e-6)
    assert np.isfinite(speed[-1])


def test_the_least_squares_window_is_the_parabola_of_polyfit() -> None:
    t = np.linspace(0.0, 3.0, 301)
    r = 30.0 + np.random.default_rng(1).normal(0.0, 0.5, len(t)) + 4.0 * t**2
    expected = np.sqrt(np.polyfit(t[-201:], r[-201:] ** 2, 2)[0])
    assert fig4.least_squares(201)(t, r)[-1] == pytest.approx(expected, rel=1e-9)


def test_narrow_key_pairs_turn_noise_into_speed_and_wide_ones_do_not() -> None:
    section = fig4.run(seeds=4)
    released = section.results["Algorithm 1, released parameters"]["200"]["mean"]
    wide = section.results["Algorithm 1, pairs 10 m apart, window 2·r"]["200"]
    assert released > 5.0
    assert abs(wide["mean"]) < 0.3
    assert wide["missing"] == 0.0
