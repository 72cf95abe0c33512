"""The tables of a cluster in a real database: one owner, and nothing that a former one writes holds."""

import re
import threading
import time
from functools import partial

import numpy as np
import pytest

from dropanchor_service.checkpoints.format import CheckpointError, Snapshot, UnreadableLayoutError
from dropanchor_service.cli import main
from dropanchor_service.cluster import leases
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import DatabaseError, connect, sentence_of
from dropanchor_service.cluster.leases import Claim, Claimant
from dropanchor_service.cluster.owner import Renewal
from dropanchor_service.cluster.shared_state import CheckpointRow, save_document
from dropanchor_service.cluster.tenure import Standing, Tenure
from support.postgresql import Postgresql, needs_postgresql
from support.zenoh_router import wait_until

pytestmark = needs_postgresql
LEASE_S = 2.0  # a thread that does not run for half as long counts as frozen
A, B, C = (
    Claimant("a", "https://a.example", "s", LEASE_S),
    Claimant("b", "", "s", LEASE_S),
    Claimant("c", "", "s", LEASE_S),
)

FULL_DISK = """
CREATE FUNCTION full_disk() RETURNS trigger LANGUAGE plpgsql AS
    $$ BEGIN RAISE EXCEPTION 'the disk is full' USING ERRCODE = 'disk_full'; END $$;
CREATE TRIGGER full_disk BEFORE UPDATE ON dropanchor_lease
    FOR EACH ROW WHEN (OLD.bucket = 'full') EXECUTE FUNCTION full_disk();
CREATE TRIGGER full_disk BEFORE UPDATE ON dropanchor_checkpoint
    FOR EACH ROW WHEN (OLD.bucket = 'full') EXECUTE FUNCTION full_disk();
"""


def claimed(database: Postgresql, bucket: str, who: Claimant = A) -> Claim:
    """Return a claim. An owner may renew the lease after it was seen; then it is seen again, as a standby does."""
    claims: list[Claim | None] = []
    with connect(database.url(), who.name) as connection:

        def has_claimed() -> bool:
            claims.append(leases.claim(connection, leases.seen_or_new(connection, bucket), who))
            return claims[-1] is not None

        wait_until(has_claimed)
    (claim,) = filter(None, claims)
    return claim


def snapshot(*numbers: float) -> Snapshot:
    return Snapshot({"numbers": np.array(numbers)}, {"site": "yard"})


def row(database: Postgresql, bucket: str, claim: Claim, layout: str = "layout") -> CheckpointRow:
    def as_present(found: str, content: Snapshot) -> Snapshot:
        if found != layout:
            raise UnreadableLayoutError(f"its layout is {found}, but this version uses {layout}")
        return content

    kept = CheckpointRow(partial(connect, database.url(), "a"), bucket, layout, as_present)
    kept.own(claim)
    return kept


def test_of_all_that_saw_the_same_lease_one_claims_it(database: Postgresql) -> None:
    with connect(database.url(), "all") as connection:
        seen = leases.seen_or_new(connection, "race")
    claims: list[Claim | None] = []

    def claim() -> None:
        with connect(database.url(), "one") as connection:
            claims.append(leases.claim(connection, seen, A))

    threads = [threading.Thread(target=claim) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(claims) == 8
    assert [each for each in claims if each is not None] == [Claim(1, b"", {})]


def test_a_lease_that_was_renewed_since_it_was_seen_is_not_claimed(database: Postgresql) -> None:
    claim = claimed(database, "renewed")
    with connect(database.url(), "b") as connection:
        seen = leases.read(connection, "renewed")
        assert seen is not None
        assert leases.renew(connection, "renewed", claim.epoch)
        assert leases.claim(connection, seen, B) is None
        leases.release(connection, "renewed", claim.epoch)
        assert leases.seen_or_new(connection, "renewed").owner == ""
        assert not leases.renew(connection, "renewed", claim.epoch - 1)


def test_a_former_owner_can_write_neither_checkpoint_nor_sites_and_its_successor_has_both(database: Postgresql) -> None:
    reach = partial(connect, database.url(), "a")
    first = claimed(database, "fenced")
    kept = row(database, "fenced", first)
    assert kept.newest() == (None, [])
    kept.write(snapshot(1.0, 2.0))
    save_document(reach, "fenced", first.epoch, "yard", b"{}")
    second = claimed(database, "fenced", B)
    assert (second.epoch, second.documents) == (2, {"yard": b"{}"})
    with pytest.raises(CheckpointError, match="another process owns the bucket fenced"):
        kept.write(snapshot(3.0))
    with pytest.raises(OSError, match="another process owns the bucket fenced"):
        save_document(reach, "fenced", first.epoch, "yard", b"old")
    found, complaints = row(database, "fenced", second).newest()
    assert found is not None
    assert (found.arrays["numbers"].tolist(), complaints) == ([1.0, 2.0], [])
    other_layout, complaints = row(database, "fenced", second, "newer").newest()
    assert other_layout is None
    assert complaints == [
        "the checkpoint of the bucket fenced is not used: its layout is layout, but this version uses newer"
    ]
    kept.close()


@pytest.mark.parametrize(
    "edit",
    [
        "UPDATE dropanchor_lease SET epoch = 0 WHERE bucket = 'edited'",
        "DELETE FROM dropanchor_lease WHERE bucket = 'edited'",
    ],
)
def test_an_owner_leaves_a_lease_that_was_edited_and_the_epoch_still_grows(database: Postgresql, edit: str) -> None:
    claim = claimed(database, "edited")
    tenure = Tenure(claim.epoch, 2.0, lambda: 0.0, lambda: True, asked_s=0.0)
    with Renewal(partial(connect, database.url(), "a"), "edited", 0.2, tenure):
        with database.connect() as connection:
            connection.execute(edit)
        wait_until(lambda: tenure.standing is Standing.LOST)
    assert "edited" in tenure.why_lost
    assert claimed(database, "edited", B).epoch == claim.epoch + 1


def test_an_owner_renews_and_gives_its_bucket_back_when_it_stops(database: Postgresql) -> None:
    claim = claimed(database, "stopped")
    tenure = Tenure(claim.epoch, 2.0, lambda: 0.0, lambda: True, asked_s=0.0)
    with connect(database.url(), "b") as connection:
        with Renewal(partial(connect, database.url(), "a"), "stopped", 0.2, tenure):
            wait_until(lambda: leases.seen_or_new(connection, "stopped").renewals >= 2)
        assert leases.seen_or_new(connection, "stopped").owner == ""


def test_a_lease_that_was_moved_is_left_only_when_the_successor_is_there(database: Postgresql) -> None:
    claim = claimed(database, "moved")
    tenure = Tenure(claim.epoch, 2.0, lambda: 0.0, lambda: True, asked_s=0.0)  # time stands still
    with Renewal(partial(connect, database.url(), "a"), "moved", 0.2, tenure):
        with connect(database.url(), "b") as connection:
            leases.set_moving(connection, "moved", True)
        successor = claimed(database, "moved", B)
        wait_until(lambda: tenure.standing is Standing.LEAVING)
        with connect(database.url(), "c") as connection:  # before the successor is ready, it moves on
            leases.set_moving(connection, "moved", True)
        claimed(database, "moved", C)
        time.sleep(0.5)  # ten renewals, which must not end it
        assert tenure.standing is Standing.LEAVING
        tenure.saw_epoch(successor.epoch)
        wait_until(lambda: tenure.standing is Standing.LOST)


def test_an_owner_whose_database_is_full_goes_on_and_says_so(database: Postgresql) -> None:
    claim = claimed(database, "full")
    kept = row(database, "full", claim)
    tenure = Tenure(claim.epoch, LEASE_S, boot_s, lambda: True, asked_s=boot_s())
    with (
        database.connect() as connection,
        Renewal(partial(connect, database.url(), "a"), "full", LEASE_S, tenure) as renewal,
    ):
        connection.execute(FULL_DISK)
        wait_until(lambda: tenure.standing is Standing.ALONE and renewal.database_error == "the disk is full")
        with pytest.raises(CheckpointError, match="the database does not take it: the disk is full"):
            kept.write(snapshot(1.0))
        connection.execute(
            "DROP TRIGGER full_disk ON dropanchor_lease; DROP TRIGGER full_disk ON dropanchor_checkpoint"
        )
        wait_until(lambda: tenure.standing is Standing.OWNER)
    assert kept.write(snapshot(1.0)) > 0
    kept.close()


def test_tables_of_another_version_are_named(database: Postgresql) -> None:
    with connect(database.url(), "a") as connection, pytest.raises(DatabaseError) as caught:
        connection.execute("SELECT colour FROM dropanchor_lease")
    assert sentence_of(caught.value).startswith("its tables are not those of this version (column")


def run(database: Postgresql, *words: str) -> int:
    return main(["cluster", *words, "--url", database.url()])


def test_the_command_shows_buckets_and_refuses_what_cannot_be(
    database: Postgresql, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = row(database, "shown", claimed(database, "shown"))
    kept.write(snapshot(*np.random.default_rng(1).normal(size=1000)))
    kept.close()
    assert run(database, "status") == 0
    lines = capsys.readouterr().out.split("shown: ")[1].splitlines()
    assert lines[0] == "epoch 1"
    assert re.fullmatch(r"  owner: a at https://a\.example, lease renewed \d+\.\d s ago", lines[1])
    assert re.fullmatch(r"  checkpoint: 0\.01 MB, \d+\.\d s old", lines[2])
    assert lines[3] == "  standbys: none"
    assert run(database, "move", "lost") == 2
    assert "there is no bucket 'lost' (known: " in capsys.readouterr().err
    assert run(database, "move", "shown") == 2
    assert "no standby of shown can take over: there is none" in capsys.readouterr().err
    with connect(database.url(), "b") as connection:
        leases.note_standby(connection, "shown", "b", "its settings of sites and tags are not those of the owner")
    assert run(database, "move", "shown") == 2
    assert "b (cannot take over: its settings" in capsys.readouterr().err
    assert run(database, "accept", "shown") == 0
    with connect(database.url(), "b") as connection:
        assert leases.seen_or_new(connection, "shown").takes_any
