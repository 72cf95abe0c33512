"""Examples of the responses about floor plans, for the OpenAPI document."""

from typing import Any

IMAGE: dict[str, Any] = {
    "id": "0123456789abcdef0123456789abcdef",
    "media_type": "image/png",
    "width_px": 2400,
    "height_px": 1600,
}
_PLACEMENT: dict[str, Any] = {"x": 12.0, "y": 8.0, "rotation_rad": 0.0, "m_per_px": 0.01}
PLAN: dict[str, Any] = {
    "id": "ground-floor",
    "name": "Ground floor",
    "image": IMAGE,
    "placement": _PLACEMENT,
    "opacity": 0.7,
    "dark_inverted": True,
    "floor": {"name": "Ground floor", "bottom_m": -0.5, "top_m": 3.5},
    "control_points": [
        {"column_px": 0.0, "row_px": 1600.0, "x": 0.0, "y": 0.0},
        {"column_px": 2400.0, "row_px": 1600.0, "x": 24.0, "y": 0.0},
    ],
}
UPLOADED: dict[str, Any] = {"image": IMAGE, "pages": 1, "placement": _PLACEMENT, "note": ""}
