"""When a standby may claim a lease: by a clock that the test moves, whatever time the row says."""

from dataclasses import replace

import pytest

from dropanchor_service.checkpoints import layouts
from dropanchor_service.cluster.watch import Lease, Watch, obstacle

HELD = Lease("yard", epoch=4, owner="a", sites="s", layout="l", renewals=7, lease_s=2.0, age_s=1e9)


def claims(watch: Watch, lease: Lease, *times_s: float) -> list[bool]:
    return [watch.may_claim(lease, now_s) for now_s in times_s]


def test_a_lease_has_ended_when_it_has_not_changed_for_its_length() -> None:
    assert claims(Watch(2.0), HELD, 0.0, 1.0, 2.0, 2.1) == [False, False, False, True]


def test_a_renewal_or_a_new_epoch_begins_the_wait_anew() -> None:
    watch = Watch(2.0)
    assert claims(watch, HELD, 0.0, 1.5) == [False, False]
    assert claims(watch, replace(HELD, renewals=8), 2.0, 3.0) == [False, False]
    assert claims(watch, replace(HELD, epoch=5, renewals=8), 4.0, 5.5, 6.1) == [False, False, True]


def test_the_longer_lease_of_the_owner_counts() -> None:
    assert claims(Watch(2.0), replace(HELD, lease_s=4.0), 0.0, 1.5, 3.0, 4.1) == [False, False, False, True]


def test_a_standby_that_did_not_look_or_whose_database_was_away_waits_anew() -> None:
    watch = Watch(2.0)
    assert claims(watch, HELD, 0.0, 30.0, 31.0) == [False, False, False]
    watch.look_away()
    assert claims(watch, HELD, 32.5, 34.0, 34.6) == [False, False, True]


def test_a_lease_without_an_owner_or_that_is_to_move_is_free_at_once() -> None:
    assert claims(Watch(2.0), replace(HELD, owner=""), 0.0) == [True]
    assert claims(Watch(2.0), replace(HELD, is_moving=True), 0.0) == [True]


def test_other_sites_and_another_layout_are_obstacles_unless_somebody_accepts_them() -> None:
    assert obstacle(HELD, "s", "l") is None
    assert obstacle(Lease("yard"), "s", "l") is None
    assert obstacle(HELD, "other", "l") == "its settings of sites and tags are not those of the owner"
    assert obstacle(HELD, "s", "m") == "the checkpoint has the layout l, but this version uses m"
    assert obstacle(replace(HELD, takes_any=True), "other", "m") is None


def test_a_standby_reads_the_layouts_before_its_own_but_no_later_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layouts, "VERSION", 5)
    own, of = "5-00000000000000aa", "{}-00000000000000bb".format
    obstacles = {version: obstacle(replace(HELD, layout=of(version)), "s", own) for version in range(1, 8)}
    assert obstacles[3] is obstacles[4] is None
    assert obstacles[2] == f"the checkpoint has the layout {of(2)}, but this version uses {own} and reads none before 3"
    assert obstacles[5] == f"the checkpoint has the layout {of(5)}, but this version uses {own}"
    assert obstacles[6] == (
        f"the checkpoint has the layout {of(6)}, which a later version wrote: install that version. This one uses {own}"
    )
    assert obstacle(replace(HELD, layout=""), "s", own) is None
