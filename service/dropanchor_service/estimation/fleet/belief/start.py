"""What a start counts from: the kind of heading, the model of its error, and the distance of a range."""

import math
from typing import Any, Final

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.heading_models import is_north_given
from dropanchor_service.estimation.fleet.belief.layout import MAGNETOMETER_MODEL, PLATFORM_MODEL, Anchor, Row
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.height import TOLD
from dropanchor_service.estimation.fleet.frontend.node import (
    ABSOLUTE_HEADING,
    DERIVED_HEADING,
    NO_HEADING,
    RELATIVE_HEADING,
    Node,
)
from dropanchor_service.estimation.fleet.tuning import Tuning

ADOPT_VAR: Final = 0.04  # rad^2, of north below which poses are in the site frame


@njit(nogil=True)
def is_in_site_frame(heading_kind: int) -> bool:
    """Return whether a node's heading counts from east."""
    return heading_kind != NO_HEADING and heading_kind != RELATIVE_HEADING


@njit(nogil=True)
def uses_heading(row: Row, node: Node) -> bool:
    """Return whether the yaw of the hypotheses counts from this node's heading."""
    magnetic = node.heading_kind == ABSOLUTE_HEADING
    return is_in_site_frame(node.heading_kind) and (not magnetic or row.heading.model == MAGNETOMETER_MODEL)


@njit(nogil=True)
def starts_at_place(row: Row) -> bool:
    """Return whether a row starts where the operator said, or where it was before a gap."""
    return bool(row.start.known == 1 or row.start.after_gap == 1)


@njit(nogil=True)
def is_mirrored(row: Row) -> bool:
    """Return whether a row may be at either of two places since its start."""
    return bool(row.start.known == 1 and math.isfinite(row.start.other_x))


@njit(nogil=True)
def is_yaw_known(row: Row, node: Node) -> bool:
    """Return whether a row that starts at a place knows its yaw there."""
    return math.isfinite(row.start.heading) or is_in_site_frame(node.heading_kind)


@njit(nogil=True)
def choose_model(row: Row, node: Node, t: Tuning) -> None:
    """Set the model of the heading error where the kind of heading gives it.

    A platform's heading is that of its travel: the mounting angle is small, and what remains is slip.
    """
    settings = row.settings
    if node.heading_kind == ABSOLUTE_HEADING:
        row.heading.model = MAGNETOMETER_MODEL
        if row.start.known == 1 and math.isfinite(row.start.heading) and not is_north_given(row):
            row.heading.north = wrap(node.heading - row.start.heading)
    if node.heading_kind == DERIVED_HEADING:
        row.heading.model = PLATFORM_MODEL
        settings.mount_angle_std = min(settings.mount_angle_std, t.mount_known_std)
        settings.slip_tau = t.platform_slip_tau
        if settings.slip_given == 0:
            settings.slip_std = t.platform_slip_std


@njit(nogil=True)
def start_distance(row: Row, z: float) -> float:
    """Return the slant distance, m, that the operator's scale and bias give a range z: (z - bias) / scale."""
    return float((z - row.settings.range_bias) / row.settings.range_scale)


@njit(nogil=True)
def horizontal_distance(row: Row, anchor: Anchor, slant: float) -> float:
    """Return the horizontal distance, m, of a tag at the distance `slant`."""
    dz = offset_of(row.settings, row.settings.height - anchor.z, slant)
    return math.sqrt(max(slant**2 - dz**2, 0.01))


@njit(nogil=True)
def offset_of(settings: Any, dz: float, distance: float) -> float:
    """Return the root of the mean square height, m, above an anchor at this distance: |dz| if the height is told."""
    if settings.height_source == TOLD:
        return dz
    return math.sqrt(dz * dz + height_variance_at(settings, distance))


@njit(nogil=True)
def height_variance_at(settings: Any, distance: float) -> float:
    """Return the variance of the height, m^2, of a tag at this distance of the anchor."""
    return float(min(settings.height_std**2, max(distance, 0.1) ** 2 / 3.0))
