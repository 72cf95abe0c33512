"""Shapes without a meaning are refused with advice."""

import numpy as np
import pytest
import shapely

from dropanchor_schemas.zones import Circle, Polygon
from dropanchor_service.zones.shapes import ShapeError, vertices_of


@pytest.mark.parametrize(
    ("points", "advice"),
    [
        ([[0, 0], [4, 4], [4, 0], [0, 4]], "order of a walk"),
        ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], "order of a walk"),
        ([[0, 0], [1, 1], [2, 2]], "not on one line"),
        ([[0, 0], [9, 0], [9, 0.001], [0, 0.001]], "at least three corners"),
        ([[0, 0], [0, 0], [0, 0]], "at least three corners"),
        ([[0, 0], [0.1, 0], [0, 0.1]], "at least three corners"),
    ],
)
def test_a_polygon_that_is_no_area_is_refused_with_advice(points: list[list[float]], advice: str) -> None:
    with pytest.raises(ShapeError, match=advice):
        vertices_of(Polygon(type="polygon", points=points))


@pytest.mark.parametrize("order", [1, -1])
def test_the_corners_come_counter_clockwise_whatever_their_order(order: int) -> None:
    points = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]][::order]
    vertices = vertices_of(Polygon(type="polygon", points=points))
    assert shapely.Polygon(vertices).exterior.is_ccw
    assert len(vertices) == 4


def test_a_circle_keeps_its_area_and_stays_within_a_centimetre() -> None:
    vertices = vertices_of(Circle(type="circle", x=3.0, y=-1.0, radius_m=20.0))
    assert shapely.Polygon(vertices).area == pytest.approx(np.pi * 400, rel=1e-6)
    assert np.abs(np.hypot(vertices[:, 0] - 3.0, vertices[:, 1] + 1.0) - 20.0).max() < 0.01
