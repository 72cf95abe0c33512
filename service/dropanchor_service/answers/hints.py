"""What a person can do about a pose: from its reason, and from how the samples of the tag arrive."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dropanchor_schemas.sentences import say
from dropanchor_service.answers.doubted_anchors import about_anchors
from dropanchor_service.answers.findings import sentence_of
from dropanchor_service.answers.reason_hints import HINTS
from dropanchor_service.answers.unused import hints_about_unused
from dropanchor_service.estimation.columns import Array, Frame, HeightSource, StateReason
from dropanchor_service.store.arrivals import BURSTS, FORGOTTEN_BURSTS, LATE_S, RANGE_S, ZEROS
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import KINDS, TagTable
from dropanchor_service.store.unknown_anchors import FRESH_NS, hint_about
from dropanchor_service.store.wrong_times import hint_about_time

RELATIVE_HINT = say(
    "relative",
    "There is no heading reference, so this track is turned about the anchor by an unknown angle: set where the tag "
    "starts and looks, or add a second anchor.",
)
MOUNT_UNKNOWN = say(
    "mount_unknown",
    "The mounting angle is not known yet: turn left and right once, or set it (`mount_angle_rad`).",
)
FORWARD_UNKNOWN = say(
    "forward_unknown",
    "Forwards cannot be told from backwards yet: brake and drive on, turn left and right, or say how the IMU is "
    "mounted (`mount_angle_rad`).",
)
FORWARD_RANGES, FORWARD_IMU = 300, 3_000  # after so many samples, walking on has not told it
HEIGHT_UNTOLD = say(
    "height_untold",
    "No floor is named, because the height at which this tag started is not known: set it (`height_m`; if it is 0, "
    "also `height_told`).",
)
RANGES_COME = say(
    "ranges_come", "Ranges arrive, but too late or too rarely: check the network, and the rate of the radio."
)
MOTION_COMES = say(
    "motion_comes",
    "The motion of this tag had a gap, and is used again after some seconds without one: check its network.",
)
LAG_S = 1.0  # from which on people see that poses come late
SENDING_S = 2.0  # a tag that has sent nothing for so long no longer sends


def late(seconds: int) -> str:
    return say("late", "Samples arrive {seconds} s late: check the clock of the tag, and its network.", seconds=seconds)


def in_bursts(seconds: int) -> str:
    return say(
        "in_bursts",
        "Samples come in bursts of {seconds} s: let the tag send smaller batches, and check its network.",
        seconds=seconds,
    )


def few_ranges(seconds: int) -> str:
    return say(
        "few_ranges",
        "One range in {seconds} s is too few: raise the rate of the radio, or bring the tag nearer to the anchor.",
        seconds=seconds,
    )


def all_zero(count: int) -> str:
    return say(
        "all_zero",
        "Its last {count} ranges are all 0: the radio measures no distance, so check it and the anchor.",
        count=count,
    )


def needs_both(ranges: int, motion: int) -> str:
    return say(
        "needs_both",
        "A position needs about 20 s of ranges and of motion samples: {ranges} and {motion} have arrived.",
        ranges=ranges,
        motion=motion,
    )


def lags(seconds: float) -> str:
    return say(
        "lags",
        "Its poses come up to {seconds} s late, because its IMU samples come in batches: shorter ones make them "
        "fresher.",
        seconds=f"{seconds:.1f}",
    )


_ALL_HINTS = [*HINTS, RELATIVE_HINT]
_NO_RANGES = (StateReason.NO_RANGE, StateReason.RANGES_MISSING)
_NO_MOTION = (StateReason.NO_HEADING, StateReason.IMU_MISSING)
_NOTHING_NEW = (StateReason.RESOLVED, *_NO_RANGES, StateReason.IMU_MISSING)
_LITTLE_KNOWN = (StateReason.RESOLVED, *_NO_RANGES, StateReason.SEVERAL_MODES, StateReason.UNCERTAIN)
_IMU, _RANGE, _HEADING, _PRESSURE = (KINDS.index(name) for name in ("imu", "range", "heading", "pressure"))

Hints = tuple[Sequence[str], Array]
"""All texts, and the index of the text of each POSE."""


def past_hints(poses: Array) -> Hints:
    """Return the hints about these POSE for their own time."""
    relative = (poses["frame"] == Frame.RELATIVE) & (poses["reason"] == StateReason.RESOLVED)
    return _ALL_HINTS, np.where(relative, len(HINTS), poses["reason"]).astype(np.int64)


def hints_of(poses: Array, site: SiteStore, tags: TagTable, now_ns: int) -> Hints:
    """Return the hints about these POSE, which are the latest and have the reasons that they have at `now_ns`.

    A cause that only the arrivals show comes before the reason: to a tag whose samples come late, ranges are missing.
    """
    texts, hint = list(_ALL_HINTS), past_hints(poses)[1]
    for text, where in (*_mounts(poses, site, tags), *_about_missing(poses, tags, now_ns)):
        hint[where] = len(texts)
        texts.append(text)
    conspicuous = np.flatnonzero(tags.arrivals.conspicuous(poses["row"]))
    for text, where in _about_arrivals(poses[conspicuous], tags, now_ns) if len(conspicuous) else ():
        hint[conspicuous[where]] = len(texts)
        texts.append(text)
    for text, place in _unknown_anchors(poses, site, tags, now_ns):
        hint[place] = len(texts)
        texts.append(text)
    for text, at in (*hints_about_unused(poses["row"], tags, now_ns), *_zeros(poses, tags, now_ns)):
        hint[at] = len(texts)
        texts.append(text)
    for text, one in _about_sensors(poses, tags):
        hint[one] = len(texts)
        texts.append(text)
    for text, one in about_anchors(poses, tags):
        hint[one] = len(texts)
        texts.append(text)
    for text, wrong in _wrong_times(poses, tags, now_ns):
        hint[wrong] = len(texts)
        texts.append(text)
    for text, where in (*_without_floor(poses, site, tags, hint), *_lags(poses, tags, hint)):
        hint[where] = len(texts)
        texts.append(text)
    return texts, hint


def _about_sensors(poses: Array, tags: TagTable) -> Iterator[tuple[str, int]]:
    """Yield what is wrong with the sensors of a tag, and the place of its pose."""
    for place in np.flatnonzero(poses["reason"] == StateReason.SENSOR_FAULT).tolist():
        for found in tags.rows.findings.of(int(poses["row"][place]))[:1]:
            yield sentence_of(found), place


def _about_arrivals(poses: Array, tags: TagTable, now_ns: int) -> Iterator[tuple[str, Array]]:
    """Yield each hint about arrivals, and which of the poses it is for. Of two for one pose the later one counts."""
    arrivals = tags.arrivals.of(poses["row"])
    age_s, burst_age_s = ((now_ns - arrivals[name]) * 1e-9 for name in ("arrival_ns", "burst_ns"))
    sends = (arrivals["arrival_ns"] > 0) & (age_s < np.maximum(SENDING_S, 2.0 * arrivals["burst_s"]))
    nothing_new, little = np.isin(poses["reason"], _NOTHING_NEW), np.isin(poses["reason"], _LITTLE_KNOWN)
    bursts = (arrivals["bursts"] >= BURSTS) & (burst_age_s < FORGOTTEN_BURSTS * arrivals["burst_s"])
    is_late, few = arrivals["delay_s"] >= LATE_S, arrivals["range_s"] > RANGE_S
    yield from _with_seconds(few_ranges, arrivals["range_s"], sends & few & little)
    yield from _with_seconds(in_bursts, arrivals["burst_s"], sends & bursts & nothing_new)
    yield from _with_seconds(late, arrivals["delay_s"], sends & is_late & nothing_new)


def _with_seconds(text: Callable[[int], str], seconds: Array, where: Array) -> Iterator[tuple[str, Array]]:
    """Yield the text with each whole number of seconds, and the places that have this number."""
    places = np.flatnonzero(where)
    whole = np.round(seconds[places]).astype(np.int64)
    for number in np.unique(whole).tolist():
        yield text(number), places[whole == number]


def _about_missing(poses: Array, tags: TagTable, now_ns: int) -> Iterator[tuple[str, Array]]:
    """Yield what is true instead where the reason says that ranges or motion are missing, but they arrive."""
    places = np.flatnonzero(np.isin(poses["reason"], (*_NO_RANGES, *_NO_MOTION)))
    if not len(places):
        return
    arrivals, lag_s = tags.arrivals.of(poses["row"][places]), tags.rows.lag_s(poses["row"][places])
    ranges, motion = ((now_ns - arrivals[name]) * 1e-9 < SENDING_S + lag_s for name in ("range_ns", "motion_ns"))
    reasons, placed = poses["reason"][places], np.isfinite(poses["x"][places])
    yield RANGES_COME, places[placed & ranges & np.isin(reasons, _NO_RANGES)]
    yield MOTION_COMES, places[placed & motion & np.isin(reasons, _NO_MOTION)]
    samples = tags.rows.counts(poses["row"][places])["samples"]
    counts = np.column_stack([samples[:, _RANGE], samples[:, _IMU] + samples[:, _HEADING]])
    begins = ~placed & (counts > 0).all(axis=1)
    ahead_s = (arrivals["motion_ns"] - arrivals["range_ns"]) * 1e-9  # both may end, one a moment before the other
    yield HINTS[StateReason.RANGES_MISSING], places[begins & (ahead_s >= SENDING_S + lag_s)]
    yield HINTS[StateReason.IMU_MISSING], places[begins & (-ahead_s >= SENDING_S + lag_s)]
    for i in np.flatnonzero(begins & (np.abs(ahead_s) < SENDING_S + lag_s)).tolist():
        yield needs_both(*counts[i].tolist()), places[i : i + 1]


def _zeros(poses: Array, tags: TagTable, now_ns: int) -> Iterator[tuple[str, int]]:
    """Yield the hint for each tag whose radio only gives ranges of 0, and its place."""
    places = np.flatnonzero(tags.arrivals.conspicuous(poses["row"]))
    arrivals = tags.arrivals.of(poses["row"][places])
    zero = (arrivals["zeros"] >= ZEROS) & ((now_ns - arrivals["range_ns"]) * 1e-9 < SENDING_S)
    for place, count in zip(places[zero].tolist(), arrivals["zeros"][zero].tolist(), strict=True):
        yield all_zero(count), place


def _without_floor(poses: Array, site: SiteStore, tags: TagTable, hint: Array) -> list[tuple[str, Array]]:
    """Return the hint for tags with a barometer that could be on a floor if somebody told where they start."""
    if not site.floors.names:
        return []
    places = np.flatnonzero((poses["z_source"] == HeightSource.START) & (hint == StateReason.RESOLVED))
    samples = tags.rows.counts(poses["row"][places])["samples"] if len(places) else np.zeros((0, len(KINDS)))
    places = places[samples[:, _PRESSURE] > 0]
    return [(HEIGHT_UNTOLD, places)] if len(places) else []


def _lags(poses: Array, tags: TagTable, hint: Array) -> Iterator[tuple[str, Array]]:
    """Yield how late the poses come of tags that wait for their IMU and need nothing else."""
    lag_s = tags.rows.lag_s(poses["row"])
    places = np.flatnonzero((lag_s >= LAG_S) & (hint == StateReason.RESOLVED))
    for place in places.tolist():
        yield lags(lag_s[place]), places[places == place]


def _mounts(poses: Array, site: SiteStore, tags: TagTable) -> list[tuple[str, Array]]:
    """Return the hint for vehicles with an IMU alone, whose mounting angle the engine still has to learn."""
    places = np.flatnonzero(np.isin(poses["reason"], (StateReason.UNCERTAIN, StateReason.SEVERAL_MODES)))
    if not len(places):
        return []
    samples = tags.rows.counts(poses["row"][places])["samples"]
    several = poses["reason"][places] == StateReason.SEVERAL_MODES
    long = (samples[:, _RANGE] >= FORWARD_RANGES) & (samples[:, _IMU] >= FORWARD_IMU)
    alone = (samples[:, _IMU] > 0) & (samples[:, _HEADING] == 0) & (long | ~several)
    places, several = places[alone], several[alone]
    settings = map(site.tag_settings, tags.rows.names(poses["row"][places].tolist()))
    unknown = np.array([tag.mount_angle_rad is None and tag.motion != "carried" for tag in settings], bool)
    hints = ((MOUNT_UNKNOWN, places[unknown & ~several]), (FORWARD_UNKNOWN, places[unknown & several]))
    return [(text, where) for text, where in hints if len(where)]


def _unknown_anchors(poses: Array, site: SiteStore, tags: TagTable, now_ns: int) -> list[tuple[str, Array]]:
    """Return the hints for tags that lack ranges and hear an anchor that the site does not have."""
    unknown = {row: name for row, number, name in tags.unknown_anchors.fresh(now_ns) if site.lacks(number)}
    if not unknown:
        return []
    lacking = np.flatnonzero(np.isin(poses["reason"], (*_NO_RANGES, StateReason.NO_HEADING)))
    places: dict[str, list[int]] = {}
    heard_ns = tags.arrivals.of(poses["row"][lacking])["range_ns"]
    for place, row, range_ns in zip(lacking.tolist(), poses["row"][lacking].tolist(), heard_ns.tolist(), strict=True):
        if row in unknown:
            text = hint_about(unknown[row], hears_others=now_ns - range_ns <= FRESH_NS)
            places.setdefault(text, []).append(place)
    return [(text, np.array(where)) for text, where in places.items()]


def _wrong_times(poses: Array, tags: TagTable, now_ns: int) -> list[tuple[str, Array]]:
    """Return the hints for tags that send times that cannot be UTC, whatever the reasons of their poses are."""
    sent = dict(tags.rows.wrong_times.fresh(now_ns))
    if not sent:
        return []
    places: dict[str, list[int]] = {}
    for place, row in enumerate(poses["row"].tolist()):
        if row in sent:
            places.setdefault(hint_about_time(sent[row]), []).append(place)
    return [(text, np.array(where)) for text, where in places.items()]
