"""The overview of many tracks: figures, a few points of each tag, and what is known between them."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
import shapely

from dropanchor_service.estimation.columns import POSE, Array, Frame, HeightSource, State
from dropanchor_service.history.errors import TooMuchError, UnfinishedSummaryError
from dropanchor_service.history.overview import Overview
from dropanchor_service.history.summaries import Between
from dropanchor_service.history.summary_table import COARSE, FINE, LENGTHS_NS
from support.history_places import FilePlace, Place, Writer, count_written

SECOND = 1_000_000_000
T_NS = 1_800_000_000 * SECOND // LENGTHS_NS[1] * LENGTHS_NS[1]
HOUR = 3600


def drive(seconds: Array, speed: float = 2.0, state: State = State.TRACKING, **fields: object) -> Array:
    """Return poses of a tag that drives east, at these seconds after T_NS."""
    made = np.zeros(len(seconds), POSE)
    made["t_ns"] = T_NS + np.round(np.asarray(seconds) * SECOND).astype(np.int64)
    made["x"], made["speed"], made["state"] = speed * np.asarray(seconds), speed, state
    made["cov"] = np.diag([0.04, 0.01, 0.001])
    for name, value in fields.items():
        made[name] = value
    return made


def store(place: Place, **tracks: Array) -> Writer:
    """Write tracks by tag, and every summary that can be written."""
    writer = place.writer()
    for tag, made in tracks.items():
        writer.insert(made, [tag] * len(made), [None] * len(made))
    summarise(writer)
    return writer


def summarise(writer: Writer) -> None:
    for _ in range(2):  # the stretches rest after the first round
        while writer.summarise():
            pass


def overview(
    place: Place, from_s: float, to_s: float, tags: list[str] | None = None, max_points: int = 100
) -> Overview:
    return place.reader.overview(tags, T_NS + round(from_s * SECOND), T_NS + round(to_s * SECOND), max_points)


def figures(found: Overview, tag: str) -> dict[str, float]:
    (row,) = (row for row in found.figures if found.names[row["tag"]] == tag)
    return {name: float(row[name]) for name in ("poses", "distance_m", "tracked_s", "max_speed")}


def points(found: Overview, tag: str) -> Array:
    numbers = [number for number, name in found.names.items() if name == tag]
    return found.points[np.isin(found.points["tag"], numbers)]


def test_figures_of_a_drive_are_its_distance_time_and_speeds(any_place: Place) -> None:
    store(any_place, a=drive(np.arange(0.0, 601.0)), b=drive(np.arange(0.0, 601.0), speed=-1.0)).close()
    found = overview(any_place, 0, 600)
    assert figures(found, "a") == {"poses": 601, "distance_m": 1200, "tracked_s": 600, "max_speed": 2}
    assert figures(found, "b") == {"poses": 601, "distance_m": 600, "tracked_s": 600, "max_speed": 1}


def test_the_noise_of_a_standing_tag_is_no_distance(place: Place) -> None:
    noisy = drive(np.arange(0.0, 300.0), speed=0.0, x=np.random.default_rng(1).normal(0, 0.2, 300))
    store(place, a=noisy).close()
    assert figures(overview(place, 0, 300), "a")["distance_m"] == 0


@pytest.mark.parametrize("hours", [(0.0, 0.5), (0.001, 7.9), (0.4999, 7.51), (0.0, 24.0)])
def test_every_level_gives_the_figures_of_the_poses(
    any_place: Place, hours: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = drive(np.arange(0.0, 8 * HOUR, 5.0))
    made["state"][300:310], made["state"][1000:1005] = State.AMBIGUOUS, State.COASTING
    made["frame"][2000:2010] = Frame.RELATIVE
    store(any_place, a=made[made["t_ns"] // SECOND % 4000 > 60], b=drive(np.arange(0.0, 8 * HOUR, 7.0))).close()
    whole = T_NS, T_NS + 9 * HOUR * SECOND
    assert [count_written(any_place, "summaries", level, *whole) for level in (FINE, COARSE)] == [239, 15]
    seen = []
    for poses, fine in ((10**9, 0), (0, 10**9), (0, 0)):
        monkeypatch.setattr("dropanchor_service.history.overview.MAX_POSES", poses)
        monkeypatch.setattr("dropanchor_service.history.overview.MAX_FINE", fine)
        found = overview(any_place, hours[0] * HOUR, hours[1] * HOUR)
        seen.append([figures(found, tag) for tag in ("a", "b")])
    assert seen[0][0]["tracked_s"] > 1000
    for other in seen[1:]:
        for expected, actual in zip(seen[0], other, strict=True):
            assert actual == pytest.approx(expected, rel=1e-5)


def test_late_poses_of_a_summarised_time_are_in_the_summary(any_place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dropanchor_service.history.overview.MAX_POSES", 0)
    monkeypatch.setattr("dropanchor_service.history.overview.MAX_FINE", 0)
    whole = drive(np.arange(0.0, 2 * HOUR, 5.0))
    writer = store(any_place, a=np.delete(whole, slice(100, 200)))
    before = figures(overview(any_place, 0, 2 * HOUR), "a")
    writer.insert(whole[100:200], ["a"] * 100, [None] * 100)
    unwritten = figures(overview(any_place, 0, 2 * HOUR), "a")
    summarise(writer)
    written = figures(overview(any_place, 0, 2 * HOUR), "a")
    assert (before["poses"], unwritten["poses"], written["poses"]) == (len(whole) - 100, len(whole), len(whole))
    assert (
        before["tracked_s"]
        < unwritten["tracked_s"]
        == written["tracked_s"]
        == whole["t_ns"][-1] / SECOND - T_NS / SECOND
    )
    writer.close()


def test_summaries_that_a_kill_left_unwritten_are_written_after_the_next_start(any_place: Place) -> None:
    writer = any_place.writer()
    writer.insert(drive(np.arange(0.0, HOUR, 5.0)), ["a"] * 720, [None] * 720)
    writer.close()
    again = any_place.writer()
    summarise(again)
    assert count_written(any_place, "summaries", FINE, T_NS, T_NS + HOUR * SECOND) == 30
    again.close()


def test_thinned_points_keep_the_first_the_last_and_changes_of_state(place: Place) -> None:
    made = drive(np.arange(0.0, 1000.0))
    made["state"][501] = State.COASTING
    store(place, a=made).close()
    found = points(overview(place, 0, 2000, max_points=20), "a")
    seconds = ((found["point"]["t_ns"] - T_NS) // SECOND).tolist()
    assert len(found) <= 20
    assert (seconds[0], seconds[-1]) == (0, 999)
    assert {501, 502} <= set(seconds)
    between = dict(zip(seconds, found["since_previous"].tolist(), strict=True))
    assert (between[501], between[502], between[999]) == (Between.DOUBTFUL, Between.DOUBTFUL, Between.TRACKING)


def rounds(hours: int) -> Array:
    """Return poses of a tag that drives around a block of 200 × 60 m, and rests every tenth minute."""
    seconds = np.arange(0.0, hours * HOUR)
    way = np.cumsum(np.where(seconds % 600 < 60, 0.0, 1.5))
    corners = np.array([0, 200, 200, 0, 0]) + 1j * np.array([0, 0, 60, 60, 0])
    along = np.interp(way % 520, [0, 200, 260, 460, 520], corners)
    return drive(seconds, x=along.real, y=along.imag)


def farthest(made: Array, line: Array) -> tuple[float, Array]:
    """Return how far a pose is from the line through these points, at most, and the same of each stretch."""
    each = [
        max((float(shapely.LineString([a, b]).distance(shapely.Point(p))) for p in between), default=0.0)
        for a, b, between in stretches(made, line)
    ]
    return max(each), np.array(each)


def stretches(made: Array, line: Array) -> Iterator[tuple[list[float], list[float], list[list[float]]]]:
    xy = np.column_stack([made["x"], made["y"]]).tolist()
    at = np.searchsorted(made["t_ns"], line["point"]["t_ns"]).tolist()
    for start, end in pairwise(at):
        yield xy[start], xy[end], xy[start + 1 : end]


def test_the_line_over_a_day_is_that_of_the_poses_or_says_how_far_they_are_from_it(any_place: Place) -> None:
    made = rounds(24)
    store(any_place, a=made).close()
    found = points(overview(any_place, 0, 24 * HOUR, max_points=5000), "a")
    assert len(found) <= 5000
    worst, each = farthest(made, found)
    assert worst < 0.5  # even in time, it is 10 m: the line cuts whole corners
    assert found["off_m"][1:] == pytest.approx(each, abs=0.01)
    few = points(overview(any_place, 0, 24 * HOUR, max_points=300), "a")
    assert few["off_m"][1:] == pytest.approx(farthest(made, few)[1], abs=0.01)
    assert np.diff(few["point"]["t_ns"]).max() < 900 * SECOND  # heights and states are seen all along


def test_how_far_summaries_are_from_their_line_is_not_known(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dropanchor_service.history.overview.MAX_POSES", 0)
    store(place, a=rounds(1)).close()
    assert np.isnan(points(overview(place, 0, HOUR), "a")["off_m"]).mean() > 0.5  # the others join two neighbours


@pytest.mark.parametrize("max_points", [2, 3, 7, 50])
def test_a_tag_that_flaps_between_states_has_no_more_points_than_allowed(place: Place, max_points: int) -> None:
    made = drive(np.arange(0.0, 1000.0))
    made["state"][::2] = State.AMBIGUOUS
    store(place, a=made, b=drive(np.arange(0.0, 1000.0))).close()
    found = overview(place, 0, 1000, max_points=max_points)
    assert 2 <= len(points(found, "a")) <= max_points
    assert 2 <= len(points(found, "b")) <= max_points
    assert set(points(found, "a")["since_previous"].tolist()) == {Between.UNKNOWN}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"state": State.AMBIGUOUS}, Between.UNKNOWN),
        ({"state": State.LOST}, Between.UNKNOWN),
        ({"frame": Frame.RELATIVE}, Between.UNKNOWN),
        ({"x": np.nan}, Between.UNKNOWN),
        ({"state": State.DEGRADED}, Between.DOUBTFUL),
        ({"t_ns": 0}, Between.UNKNOWN),
        ({}, Between.TRACKING),
    ],
)
def test_one_pose_that_is_no_place_breaks_the_line_at_every_level(
    place: Place, change: dict[str, object], expected: Between, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = drive(np.arange(0.0, 4 * HOUR, 5.0))
    for name, value in change.items():
        made[name][1005] = value
    if "t_ns" in change:  # a gap
        made = np.delete(made, slice(1005, 1008))
    store(place, a=made).close()
    for poses, fine in ((10**9, 0), (0, 10**9), (0, 0)):
        monkeypatch.setattr("dropanchor_service.history.overview.MAX_POSES", poses)
        monkeypatch.setattr("dropanchor_service.history.overview.MAX_FINE", fine)
        found = points(overview(place, 0, 4 * HOUR, max_points=2), "a")
        assert found["since_previous"].tolist() == [Between.UNKNOWN, expected]


def test_only_the_named_tags_are_read(any_place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    store(any_place, **{f"t{i}": drive(np.arange(0.0, HOUR, 10.0)) for i in range(5)}).close()
    for most in (0, 100):
        monkeypatch.setattr("dropanchor_service.history.sqlite.rows.MAX_NAMED", most)
        found = overview(any_place, 0, HOUR, ["t1", "t3", "nobody"])
        assert {found.names[row["tag"]] for row in found.figures} == {"t1", "t3"}
    assert len(overview(any_place, 0, HOUR, ["nobody"]).points) == 0


def test_a_long_period_without_summaries_is_refused_with_a_reason(
    any_place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = any_place.writer()
    writer.insert(drive(np.arange(0.0, HOUR, 10.0)), ["a"] * 360, [None] * 360)
    monkeypatch.setattr("dropanchor_service.history.covering.MAX_TAG_SLOTS", 100)
    with pytest.raises(UnfinishedSummaryError, match="still being made"):
        overview(any_place, 0, HOUR)
    writer.close()
    again = any_place.writer()
    summarise(again)
    assert figures(overview(any_place, 0, 720 * HOUR), "a")["poses"] == 360
    again.close()


def test_a_period_with_too_many_summaries_is_refused_with_a_reason(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    store(place, a=drive(np.arange(0.0, 60 * HOUR, 60.0))).close()
    monkeypatch.setattr("dropanchor_service.history.covering.MAX_BYTES", 10_000)
    with pytest.raises(TooMuchError, match="name the tags"):
        overview(place, 0, 60 * HOUR)
    assert figures(overview(place, 0, 20 * HOUR), "a")["poses"] == 1201


def test_points_have_the_heights_of_their_poses_from_poses_and_summaries(
    any_place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = np.arange(0.0, HOUR, 10.0)
    climb = drive(seconds, z=seconds / 100, z_std=0.25, z_source=HeightSource.PRESSURE)
    store(any_place, a=climb).close()
    for poses in (200_000, 0):  # one by one, and from summaries
        monkeypatch.setattr("dropanchor_service.history.overview.MAX_POSES", poses)
        found = points(overview(any_place, 0, HOUR), "a")["point"]
        np.testing.assert_allclose(found["z"], (found["t_ns"] - T_NS) / SECOND / 100, rtol=1e-6)
        assert set(found["z_std"].tolist()) == {0.25}
        assert set(found["z_source"].tolist()) == {HeightSource.PRESSURE}


def test_summaries_end_with_the_poses_that_they_summarise(place: FilePlace) -> None:
    store(place, a=drive(np.arange(0.0, 4 * HOUR, 10.0))).close()
    writer = place.writer()
    while writer.prune(T_NS + 3 * HOUR * SECOND, 2**40):
        pass
    assert figures(overview(place, 0, 720 * HOUR), "a")["poses"] == 360
    writer.close()
