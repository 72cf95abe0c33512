"""A service goes on from what the versions before it have written, with nothing lost."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest
from numpy.lib.recfunctions import append_fields, drop_fields, repack_fields

from dropanchor_service.checkpoints import layouts
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.format import CheckpointError, Snapshot, UnreadableLayoutError, decoded, encoded
from dropanchor_service.checkpoints.migrations import STEPS, migrated
from dropanchor_service.checkpoints.thread import CheckpointThread
from dropanchor_service.estimation.columns import Array, State, default_settings
from dropanchor_service.estimation.fleet.measurement.rest import QUIET_START
from support.golden_checkpoint import Drive, golden, halves

EARLIER = f"{layouts.VERSION - 1}-{'0' * 16}"
LAYOUT = "10-9ed70e7a14de4f89"
READ = range(layouts.VERSION - layouts.READ_BEFORE, layouts.VERSION)


def reloaded(folder: Path, whole: bytes) -> Drive:
    """Return a service that has started with this checkpoint."""
    (folder / "checkpoints").mkdir()
    (folder / "checkpoints" / "checkpoint-000000000007").write_bytes(whole)
    drive = Drive(folder)
    kept = CheckpointFolder(folder / "checkpoints", drive.state.layout, drive.state.as_present)
    CheckpointThread(drive.state, kept, drive.bench.metrics, 1.0, drive.bench.clock).load()
    return drive


def test_whoever_changes_the_columns_of_the_state_gives_the_layout_a_new_number(tmp_path: Path) -> None:
    assert Drive(tmp_path).state.layout == LAYOUT, "do what checkpoints/migrations.py says, then correct this name"


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Array:
    """The latest poses after both halves, without a restart."""
    drive = Drive(tmp_path_factory.mktemp("uninterrupted"))
    for half in halves():
        drive.send(half)
    return drive.bench.latest.since()[1]


@pytest.mark.parametrize("version", READ)
def test_a_service_goes_on_from_each_layout_that_it_reads(version: int, uninterrupted: Array, tmp_path: Path) -> None:
    _, before = decoded(golden(version))
    drive = reloaded(tmp_path, golden(version))
    assert [tag.name for tag in drive.bench.tags.all()] == before.document["tags"]
    assert [tag.messages for tag in drive.bench.tags.all()] == before.arrays["counts"]["messages"].tolist()
    loaded = drive.bench.latest.since()[1]
    for name in ("row", "t_ns", "x", "y", "heading", "cov"):
        assert np.array_equal(loaded[name], before.arrays["latest.poses"][name])
    assert len(drive.bench.latest.hypotheses(2)) == np.sum(before.arrays["latest.hypotheses"]["row"] == 2) > 1
    rest = halves()[1]
    drive.send(rest)
    after = drive.bench.latest.since()[1]
    assert after["t_ns"].tolist() == uninterrupted["t_ns"].tolist()
    assert after["state"].tolist() == uninterrupted["state"].tolist()
    tracking = after["state"] == State.TRACKING
    assert tracking.sum() >= 2
    apart = np.hypot(after["x"] - uninterrupted["x"], after["y"] - uninterrupted["y"])
    assert (apart < uninterrupted["sigma_pos"])[tracking].all()
    for name, within in (("speed", 0.3), ("p_mode", 0.1)):
        assert after[name][tracking] == pytest.approx(uninterrupted[name][tracking], abs=within)
    assert sum(tag.messages for tag in drive.bench.tags.all()) == before.arrays["counts"]["messages"].sum() + len(rest)
    assert drive.bench.rejected() == {}


def earlier(present: Snapshot) -> Snapshot:
    """Return a snapshot as a version could have written it that had other columns, in another order."""
    arrays = dict(present.arrays)
    rows: Any = drop_fields(arrays["engine.rows"], ["quiet_share", "heading"])
    rows = append_fields(rows, "gone", np.full(len(rows), 5.0), usemask=False)
    turned: Array = rows[list(reversed(rows.dtype.names))]
    arrays["engine.rows"] = repack_fields(turned, recurse=True)
    arrays["engine.pool"] = drop_fields(arrays["engine.pool"], "reverse")
    arrays["latest.poses"] = drop_fields(arrays["latest.poses"], ["p_mode", "frame"])
    arrays["engine.settings"] = drop_fields(arrays["engine.settings"], ["heading_std", "range_scale"])
    del arrays["engine.platforms"]
    arrays["removed"] = np.zeros(3, "f4")
    return Snapshot(arrays, present.document)


def test_equal_columns_are_copied_new_ones_are_those_of_a_fresh_tag_and_dropped_ones_go(tmp_path: Path) -> None:
    drive = Drive(tmp_path)
    present = drive.state.as_present(*decoded(golden(layouts.VERSION - 1)))
    found = drive.state.as_present(EARLIER, earlier(present))
    assert found.dtypes == present.dtypes
    assert all(
        found.arrays[name].dtype.isalignedstruct == array.dtype.isalignedstruct
        for name, array in present.arrays.items()
    )
    rows, before = found.arrays["engine.rows"], present.arrays["engine.rows"]
    for name in ("settings", "first_slot", "count", "publication", "t_ns", "lever_rate"):
        assert rows[name].tobytes() == before[name].tobytes()
    assert rows["quiet_share"].tolist() == [QUIET_START] * 3
    assert not rows["heading"]["models_started"].any()
    pool, slots = found.arrays["engine.pool"], present.arrays["engine.pool"]
    assert (pool["cov"] == slots["cov"]).all()
    assert not pool["reverse"].any()
    poses = found.arrays["latest.poses"]
    assert np.isnan(poses["p_mode"]).all()
    assert poses["frame"].tolist() == [0, 0, 0]
    assert len(found.arrays["engine.platforms"]) == 3
    assert found.arrays["engine.settings"].tobytes() == present.arrays["engine.settings"].tobytes()
    drive.state.restore(found)
    drive.send(halves()[1])
    assert {State.TRACKING} <= set(drive.bench.latest.since()[1]["state"].tolist())


def test_a_changed_column_needs_a_step_or_the_checkpoint_is_refused_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    present = Drive(tmp_path).state.as_present(*decoded(golden(layouts.VERSION - 1)))
    counts = present.arrays["counts"]
    fewer = np.zeros(len(counts), [("messages", "f4"), ("samples", "i8", 2)])
    fewer["messages"] = counts["messages"]
    whole = b"".join(encoded(Snapshot(present.arrays | {"counts": fewer}, present.document), EARLIER))
    drive = reloaded(tmp_path, whole)
    assert drive.bench.tags.all() == []
    assert f"its layout is {EARLIER}, but counts.messages was float32 and is int64 in this version" in caplog.text
    assert (tmp_path / "checkpoints" / "unread-checkpoint-000000000007").read_bytes() == whole

    def step(found: Snapshot) -> Snapshot:
        new = np.zeros(len(found.arrays["counts"]), [("messages", "i8")])
        new["messages"] = found.arrays["counts"]["messages"]
        return Snapshot(found.arrays | {"counts": new}, found.document)

    monkeypatch.setitem(STEPS, layouts.VERSION - 1, step)
    assert drive.state.as_present(*decoded(whole)).arrays["counts"]["messages"].tolist() == counts["messages"].tolist()


@pytest.mark.parametrize(
    "layout", [f"{layouts.VERSION + 1}-{'0' * 16}", f"{layouts.VERSION}-{'0' * 16}", "else", "02-1"]
)
def test_no_other_layout_is_read(layout: str, tmp_path: Path) -> None:
    state = Drive(tmp_path).state
    _, found = decoded(golden(layouts.VERSION - 1))
    with pytest.raises(UnreadableLayoutError, match=f"its layout is {layout}, .*his .*uses {state.layout}"):
        state.as_present(layout, found)


def test_the_first_layout_which_does_not_list_its_columns_is_not_read_any_more() -> None:
    header = orjson.dumps({"layout": "fa8bf211067538b1", "shapes": {}, "document": {}}) + b"\n"
    with pytest.raises(UnreadableLayoutError, match="its layout is fa8bf211067538b1, which this version does not read"):
        decoded(header + hashlib.blake2b(header, digest_size=32).digest())


def test_a_checkpoint_without_the_settings_of_its_tags_is_refused() -> None:
    with pytest.raises(CheckpointError, match=r"it has no engine\.settings"):
        migrated(Snapshot(), 1, {}, lambda _: {})


def test_a_new_setting_has_its_default_so_that_the_tag_goes_on() -> None:
    old = drop_fields(np.full(2, default_settings()), "range_scale")
    dtypes = {"engine.settings": default_settings().dtype}
    assert migrated(Snapshot({"engine.settings": old}), 1, dtypes, lambda _: {}).arrays["engine.settings"][
        "range_scale"
    ].tolist() == [1.0, 1.0]
