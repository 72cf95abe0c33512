"""The heat map: for how long tags were where, however long the period is."""

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.history.errors import TooMuchError
from dropanchor_service.history.heat_cells import CELL, HEAD, Heat, merged
from dropanchor_service.history.heat_map import HeatMap, heat_map_of
from dropanchor_service.history.summary_table import DAY, LENGTHS_NS, LEVELS
from service.history.test_overview import HOUR, SECOND, drive, store, summarise
from support.history_places import FilePlace, Place, count_written

START_NS = 1_800_000_000 * SECOND // LENGTHS_NS[DAY] * LENGTHS_NS[DAY]
DAY_S = 24 * HOUR


def days(made: Array) -> Array:
    """Return the poses from the start of a day."""
    made["t_ns"] += START_NS - int(made["t_ns"][0])
    return made


def heat_map(place: Place, from_s: float, to_s: float, tags: list[str] | None = None, cell_m: float = 0.5) -> HeatMap:
    return place.reader.heat_map(tags, START_NS + round(from_s * SECOND), START_NS + round(to_s * SECOND), cell_m)


def seconds_at(found: HeatMap, x: float, y: float) -> float:
    """Return the time in the cell that holds a point."""
    here = (np.abs(found.x - x) <= found.cell_m / 2) & (np.abs(found.y - y) <= found.cell_m / 2)
    return float(found.seconds[here].sum())


def test_time_is_counted_where_the_tag_was(place: Place) -> None:
    store(place, a=days(drive(np.arange(0.0, 21.0), speed=-1.0, y=3.2))).close()
    found = heat_map(place, 0, 20, cell_m=1.0)
    assert (found.tags, found.cell_m, found.left_out_s, found.seconds.sum()) == (1, 1.0, 0, 20)
    assert [seconds_at(found, x + 0.5, 3.5) for x in (0, -1, -19, -20)] == [1, 1, 1, 0]
    assert seconds_at(found, -0.5, 2.5) == 0


def test_a_standing_tag_with_few_poses_is_there_all_the_time_but_not_through_a_gap(place: Place) -> None:
    store(place, a=days(drive(np.array([0.0, 10.0, 20.0, 31.0, 41.0]), speed=0.0))).close()
    found = heat_map(place, 0, 100)
    assert (seconds_at(found, 0.25, 0.25), found.left_out_s) == (30, 0)


@pytest.mark.parametrize(
    "change",
    [{"state": State.AMBIGUOUS}, {"state": State.LOST}, {"state": State.INITIALISING}, {"frame": Frame.RELATIVE}],
)
def test_poses_that_are_no_place_are_left_out_and_counted(place: Place, change: dict[str, object]) -> None:
    made = days(drive(np.arange(0.0, 101.0), speed=0.0))
    for name, value in change.items():
        made[name][20:50] = value
    store(place, a=made).close()
    found = heat_map(place, 0, 100)
    assert (found.seconds.sum(), found.left_out_s) == (70, 30)


def test_every_level_gives_the_time_of_the_poses(any_place: Place) -> None:
    """Two tags over a day and a bit: read from the whole day, and pose by pose."""
    circles = np.arange(0.0, 1.1 * DAY_S, 7.0)
    first, second = days(drive(circles)), days(drive(circles, speed=0.0, y=-2.0))
    first["x"], first["y"] = 4 * np.cos(circles / 40), 4 * np.sin(circles / 40)
    first["state"][500:600] = State.AMBIGUOUS
    writer = any_place.writer()
    for tag, made in (("a", np.delete(first, slice(9000, 9100))), ("b", second)):
        writer.insert(made, [tag] * len(made), [None] * len(made))
    unsummarised = heat_map(any_place, 100.5, 1.05 * DAY_S)
    summarise(writer)
    writer.close()
    whole = START_NS, START_NS + 3 * DAY_S * SECOND
    assert [count_written(any_place, "heat", level, *whole) for level in LEVELS] == [791, 52, 1]
    found = heat_map(any_place, 100.5, 1.05 * DAY_S)
    assert (found.tags, found.cell_m) == (2, 0.5)
    assert found.left_out_s == pytest.approx(unsummarised.left_out_s)
    assert found.left_out_s == pytest.approx(700)
    assert found.seconds.sum() == pytest.approx(2 * (1.05 * DAY_S - 100.5) - 700 - 707, abs=30)
    assert len(found.seconds) == len(unsummarised.seconds)
    for x, y, seconds in zip(unsummarised.x, unsummarised.y, unsummarised.seconds, strict=True):
        assert seconds_at(found, x, y) == pytest.approx(seconds, rel=1e-4)
    assert heat_map(any_place, 0, 3 * DAY_S, ["b"]).seconds.sum() == pytest.approx(circles[-1], rel=1e-4)


def test_late_poses_are_counted_before_and_after_their_summary(any_place: Place) -> None:
    whole = days(drive(np.arange(0.0, 2 * HOUR, 5.0), speed=0.0))
    writer = store(any_place, a=np.delete(whole, slice(100, 200)))
    before = heat_map(any_place, 0, 2 * HOUR).seconds.sum()
    writer.insert(whole[100:200], ["a"] * 100, [None] * 100)
    unwritten = heat_map(any_place, 0, 2 * HOUR).seconds.sum()
    summarise(writer)
    written = heat_map(any_place, 0, 2 * HOUR).seconds.sum()
    writer.close()
    assert (before, unwritten, written) == pytest.approx((7195 - 505, 7195, 7195))


def test_cells_of_a_tag_that_was_everywhere_become_larger_and_keep_their_time() -> None:
    heads = np.zeros(2, HEAD)
    heads["tag"] = 1, 2
    cells = np.zeros(40_010, CELL)
    cells["tag"], cells["seconds"] = 1, 0.25
    cells["x"], cells["y"] = np.divmod(np.arange(40_010), 200)
    cells["x"] -= 100
    cells["tag"][40_000:] = 2
    made = merged([Heat(heads, cells)], 1000).cells
    mine = made[made["tag"] == 1]
    assert (len(mine), set(mine["size"].tolist()), mine["seconds"].sum()) == (650, {3}, 10_000)
    assert (mine["x"].min(), mine["x"].max(), mine["y"].min(), mine["y"].max()) == (-13, 12, 0, 24)
    assert made["size"][made["tag"] == 2].tolist() == [0] * 10


def test_a_heat_map_has_at_most_so_many_cells(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dropanchor_service.history.heat_map.MAX_SQUARES", 10)
    store(place, a=days(drive(np.arange(0.0, 101.0), speed=1.0))).close()
    found = heat_map(place, 0, 100)
    assert (len(found.seconds), found.cell_m, found.seconds.sum()) == (7, 16.0, 100)


def test_squares_of_a_wide_area_are_larger(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dropanchor_service.history.heat_map._MAX_AREA", 16)
    store(place, a=days(drive(np.arange(0.0, 101.0), speed=-1.0))).close()
    found = heat_map(place, 0, 100)
    assert (found.cell_m, len(found.seconds), found.seconds.sum()) == (8.0, 14, 100)


def test_time_in_a_larger_cell_is_spread_evenly_and_leaves_the_others_sharp() -> None:
    cells = np.zeros(3, CELL)
    cells["size"], cells["x"], cells["y"], cells["seconds"] = [0, 3, 1], [5, -1, 2], [-3, 0, -1], [7.0, 64.0, 4.0]
    found = heat_map_of(Heat(np.zeros(1, HEAD), cells), 0.5)
    assert (found.cell_m, len(found.seconds), found.seconds.sum()) == (0.5, 1 + 64 + 4, 75)
    assert seconds_at(found, 2.75, -1.25) == 7
    assert [seconds_at(found, x, y) for x, y in ((-0.25, 0.25), (-3.75, 3.75), (2.25, -0.25), (2.75, -0.75))] == [1] * 4
    merged_into_one = heat_map_of(Heat(np.zeros(1, HEAD), cells), 16.0)
    assert sorted(merged_into_one.seconds.tolist()) == [11, 64]


def test_a_place_beyond_all_cells_is_left_out(place: Place) -> None:
    store(place, a=days(drive(np.arange(0.0, 11.0), speed=0.0, x=1e6))).close()
    found = heat_map(place, 0, 10)
    assert (len(found.seconds), found.left_out_s) == (0, 10)


def test_unknown_tags_and_no_history_give_an_empty_map(any_place: Place) -> None:
    assert heat_map(any_place, 0, 10).tags == 0
    store(any_place, a=days(drive(np.arange(0.0, 11.0)))).close()
    assert heat_map(any_place, 0, 10, ["nobody"]).seconds.sum() == 0
    assert heat_map(any_place, 0, 10, []).tags == 0


def test_a_period_with_too_much_is_refused(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    store(place, a=days(drive(np.arange(0.0, 3 * HOUR, 5.0)))).close()
    monkeypatch.setattr("dropanchor_service.history.covering.MAX_BYTES", 100)
    with pytest.raises(TooMuchError, match="name the tags"):
        heat_map(place, 0, 3 * HOUR)


def test_heat_ends_with_the_poses_that_it_counts(place: FilePlace) -> None:
    store(place, a=days(drive(np.arange(0.0, 2 * DAY_S, 10.0), speed=0.0))).close()
    writer = place.writer()
    while writer.prune(START_NS + DAY_S * SECOND, 2**40):
        pass
    assert heat_map(place, 0, 3 * DAY_S).seconds.sum() == pytest.approx(DAY_S - 10)
    writer.close()
