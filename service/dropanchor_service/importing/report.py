"""The table of what was found."""

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.join import NS_PER_S, Joined
from dropanchor_service.importing.tables.times import UTC_S

GAP_PERIODS, GAP_S = 5.0, 0.2  # a step is a gap when it is longer than so many usual ones, and than this
_HEAD = ("sensor", "samples", "rate", "from", "to", "gaps", "values")


def report(joined: Joined) -> list[str]:
    """Return the lines of the table, and the clocks."""
    imu, ranges, headings = joined.imu, joined.ranges, joined.headings
    rows: list[Sequence[str]] = [_HEAD]
    if len(imu):
        has_field = np.isfinite(imu.mag[:, 0])
        rows.append(_row("acc", imu.t_ns, f"median {_median_norm(imu.acc):.3g} m/s²"))
        rows.append(_row("gyro", imu.t_ns, f"largest {np.linalg.norm(imu.gyro, axis=1).max():.3g} rad/s"))
        if has_field.any():
            rows.append(_row("mag", imu.t_ns[has_field], f"median {_median_norm(imu.mag[has_field]):.3g} µT"))
    rows += [_range_row(joined, anchor) for anchor in sorted(Counter(ranges.anchors))]
    if len(headings):
        degrees = np.degrees(headings.yaw_rad)
        rows.append(_row("heading", headings.t_ns, f"{degrees.min():.0f}° to {degrees.max():.0f}°"))
    if len(joined.pressures):
        pa = joined.pressures.values[:, 0]
        rows.append(_row("pressure", joined.pressures.t_ns, f"{pa.min():.0f} to {pa.max():.0f} Pa"))
    if len(joined.truth):
        low, high = joined.truth.values[:, :2].min(0), joined.truth.values[:, :2].max(0)
        extent = f"{low[0]:.3g} to {high[0]:.3g} m, {low[1]:.3g} to {high[1]:.3g} m"
        rows.append(_row("truth", joined.truth.t_ns, extent))
    return [*_aligned(rows), *_clocks(joined)]


def overlap_s(a: Array, b: Array) -> float:
    """Return for how long two sensors were recorded together, s; negative: how far apart they are."""
    return float(min(a[-1], b[-1]) - max(a[0], b[0])) / NS_PER_S


def _range_row(joined: Joined, anchor: str) -> tuple[str, ...]:
    ranges = joined.ranges
    here = np.array([found == anchor for found in ranges.anchors])
    values = ranges.range_m[here]
    text = f"{values.min():.3g} to {values.max():.3g} m, median {np.median(values):.3g} m"
    return _row(f"range to {anchor}", ranges.t_ns[here], text)


def _row(name: str, t_ns: Array, values: str) -> tuple[str, ...]:
    start_s, end_s = (t_ns[0] / NS_PER_S, t_ns[-1] / NS_PER_S)
    rate = (len(t_ns) - 1) / (end_s - start_s) if end_s > start_s else 0.0
    return name, str(len(t_ns)), f"{rate:.3g} Hz", f"{start_s:.2f} s", f"{end_s:.2f} s", _gaps(t_ns), values


def _gaps(t_ns: Array) -> str:
    steps_s = np.diff(t_ns) / NS_PER_S
    gaps = steps_s[steps_s > max(GAP_S, GAP_PERIODS * float(np.median(steps_s)))] if len(steps_s) else steps_s
    return f"{len(gaps)}, longest {gaps.max():.3g} s" if len(gaps) else "none"


def _median_norm(vectors: Array) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def _clocks(joined: Joined) -> Iterator[str]:
    if UTC_S[0] * NS_PER_S <= joined.t0_ns < UTC_S[1] * NS_PER_S:
        moment = datetime.fromtimestamp(joined.t0_ns / NS_PER_S, UTC)
        yield f"t_s = 0 is {moment:%Y-%m-%d %H:%M:%S} UTC (dropanchor-tag replay --t0-ns {joined.t0_ns})"
    elif joined.t0_ns:
        yield f"t_s = 0 is {joined.t0_ns / NS_PER_S:.0f} s on the clock of the source"
    if not len(joined.imu) or not len(joined.ranges):
        return
    together_s = overlap_s(joined.imu.t_ns, joined.ranges.t_ns)
    if together_s > 0:
        yield f"clocks: the IMU and the ranges overlap for {together_s:.1f} s"
    else:
        yield (
            f"clocks: the IMU and the ranges do not overlap: they are {-together_s:.1f} s apart, and a replay "
            "never has both. Do their times come from one clock, in one unit?"
        )


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[place]) for row in rows) for place in range(len(_HEAD))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
