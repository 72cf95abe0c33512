"""What is drawn of poses that are unknown, ambiguous, or not in the site's frame."""

import struct
from math import hypot, pi
from typing import Any

import pytest

from dropanchor_service.bridges.foxglove_scene import ellipse_points, location_fixes, pose_in_frame, scene, transforms
from dropanchor_service.bridges.frames import frame_id, in_its_frame

ELLIPSE = {"semi_major_m": 2.0, "semi_minor_m": 1.0, "angle_rad": pi / 2}


def pose(**fields: Any) -> dict[str, Any]:
    unknown = dict.fromkeys(("x", "y", "heading_rad", "ellipse_95", "lat", "lon"))
    return {"tag": "Süd 1", "t_ns": 10**18, "state": "tracking", "frame": "site", "hypotheses": []} | unknown | fields


def test_the_major_axis_of_an_ellipse_points_to_its_angle() -> None:
    points = ellipse_points(2.0, 1.0, pi / 2)
    longest = max(points, key=lambda point: hypot(*point))
    assert abs(longest[1]) == pytest.approx(2.0)
    assert min(hypot(*point) for point in points) == pytest.approx(1.0)


def test_a_tag_without_a_position_is_not_drawn() -> None:
    assert b"S\xc3\xbcd" not in scene([pose()], [], {}, 0).encode()
    assert transforms([pose()], [], {}, 0).encode() == b""


def test_a_location_has_the_altitude_of_the_pose() -> None:
    found = [location_fixes([pose(lat=52.5, lon=13.4, alt_m=alt_m)]).encode() for alt_m in (37.75, None)]
    assert [struct.pack("<d", 37.75) in message for message in found] == [True, False]


def test_hypotheses_are_drawn_before_there_is_a_position() -> None:
    one = {"weight": 0.5, "x": 1.0, "y": 2.0, "ellipse_95": ELLIPSE}
    assert b"tag/" in scene([pose(state="ambiguous", hypotheses=[one])], [], {}, 0).encode()


def test_a_pose_in_a_frame_of_its_own_is_never_drawn_in_the_frame_of_the_site() -> None:
    own = {"x": 1.0, "y": 2.0, "heading_rad": 0.0, "ellipse_95": ELLIPSE, "hypotheses": []}
    relative = pose(state="relative", frame="relative", relative_pose=own)
    assert (frame_id(relative), frame_id(pose())) == ("site/Süd 1", "site")
    in_frame = pose_in_frame(in_its_frame(relative), 0.0)
    for message in (scene([relative], [], {}, 0), transforms([relative], [], {}, 0), in_frame):
        assert "site/Süd 1".encode() in message.encode()
