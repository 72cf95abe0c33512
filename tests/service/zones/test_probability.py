"""The probability of a zone agrees with closed forms and with a dense Monte Carlo."""

import logging
import math

import numpy as np
import shapely

from dropanchor_service.zones.pair_watch import PLACE, p_close
from dropanchor_service.zones.probability import p_inside
from dropanchor_service.zones.shapes import disc

SAMPLES = 400_000

_log = logging.getLogger(__name__)


def phi(z: float) -> float:
    return 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))


def test_a_rectangle_along_the_axes_has_a_closed_form() -> None:
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(2000):
        (x, y), (w, h) = rng.uniform(-10, 10, 2), rng.uniform(0.2, 20, 2)
        sx, sy = np.exp(rng.uniform(math.log(0.02), math.log(5.0), 2))
        corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
        exact = (phi((x + w) / sx) - phi(x / sx)) * (phi((y + h) / sy) - phi(y / sy))
        worst = max(worst, abs(p_inside(0.0, 0.0, np.diag([sx**2, sy**2]), corners, 0, 4) - exact))
    _log.info("Rectangles: worst error %.1e.", worst)
    assert worst < 1e-4


def test_a_circle_around_the_mean_has_a_closed_form() -> None:
    rng = np.random.default_rng(2)
    for radius, std in zip(rng.uniform(0.3, 30, 300), np.exp(rng.uniform(-3, 2, 300)), strict=True):
        corners = disc(radius)
        p = p_inside(0.0, 0.0, np.eye(2) * std**2, corners, 0, len(corners))
        assert abs(p - (1.0 - math.exp(-(radius**2) / (2 * std**2)))) < 1e-4


def test_any_polygon_and_covariance_agree_with_a_dense_monte_carlo() -> None:
    rng = np.random.default_rng(3)
    standard = rng.standard_normal((SAMPLES, 2))
    worst = 0.0
    for _ in range(60):
        n = int(rng.integers(3, 12))
        angle = np.sort(rng.uniform(0, 2 * math.pi, n)) + 0.01 * np.arange(n)
        corners = rng.uniform(1, 8, n)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        polygon = shapely.Polygon(corners)
        if not polygon.is_valid or polygon.exterior.is_ccw is False:
            continue
        root = rng.normal(0, math.exp(rng.uniform(-2, 1.5)), (2, 2))
        mean = rng.uniform(-8, 8, 2)
        counted = shapely.contains_xy(polygon, *(mean + standard @ root.T).T).mean()
        worst = max(worst, abs(p_inside(mean[0], mean[1], root @ root.T, corners, 0, n) - counted))
    _log.info("Polygons: worst difference from %s samples %.1e.", SAMPLES, worst)
    assert worst < 5 * 0.5 / math.sqrt(SAMPLES)  # five standard deviations of the Monte Carlo itself


def test_a_tag_without_a_spread_is_inside_or_outside() -> None:
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    assert p_inside(2.0, 2.0, np.zeros((2, 2)), corners, 0, 4) > 0.999
    assert p_inside(4.1, 2.0, np.zeros((2, 2)), corners, 0, 4) < 0.001


def test_the_distance_of_two_tags_with_heights_agrees_with_a_dense_monte_carlo() -> None:
    rng = np.random.default_rng(4)
    standard = rng.standard_normal((SAMPLES, 3))
    worst = 0.0
    for _ in range(60):
        pair = np.zeros(2, PLACE)
        root, std = rng.normal(0, 0.5, (2, 2)), rng.uniform(0.05, 1.0)
        pair["x"][1], pair["y"][1], pair["z"][1] = mean = rng.uniform(-4, 4, 3)
        pair["cov"][1], pair["z_std"][1], pair["weight"], pair["floor"] = root @ root.T, std, 1.0, -1
        apart = mean + np.column_stack([standard[:, :2] @ root.T, std * standard[:, 2]])
        counted = (np.linalg.norm(apart, axis=1) < 4.0).mean()
        worst = max(worst, abs(p_close(pair[0], pair[1], 4.0, disc(4.0)) - counted))
    _log.info("Pairs with heights: worst difference from %s samples %.2g.", SAMPLES, worst)
    assert worst < 0.02
