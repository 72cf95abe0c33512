"""Checkpoints as objects: the row names the one that holds, and a former owner cannot change that."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from uuid import uuid4

import pytest

from dropanchor_service.checkpoints.format import CheckpointError, Snapshot
from dropanchor_service.checkpoints.objects import ObjectFolder
from dropanchor_service.cluster import checkpoint_objects, leases
from dropanchor_service.cluster.checkpoint_objects import CheckpointObjects
from dropanchor_service.cluster.database import connect
from dropanchor_service.cluster.leases import Claim
from service.cluster.test_leases import B, claimed, row, snapshot
from support.postgresql import Postgresql, needs_postgresql
from support.s3 import S3, running_s3

pytestmark = needs_postgresql


@pytest.fixture(scope="module")
def s3() -> Iterator[S3]:
    with running_s3() as server:
        yield server


@pytest.fixture(params=["file", "memory", "s3"])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> ObjectFolder:
    """Return a folder that is empty."""
    if request.param == "s3":
        return ObjectFolder(f"{request.getfixturevalue('s3').url}/{uuid4()}")
    return ObjectFolder(f"file://{tmp_path}/share" if request.param == "file" else f"memory://{uuid4()}")


@pytest.fixture
def bucket() -> str:
    return uuid4().hex


def objects(database: Postgresql, bucket: str, folder: ObjectFolder, claim: Claim) -> CheckpointObjects:
    kept = CheckpointObjects(partial(connect, database.url(), "a"), bucket, folder, "layout", lambda _, it: it)
    kept.own(claim)
    return kept


def numbers(found: tuple[Snapshot | None, list[str]]) -> tuple[list[float] | None, list[str]]:
    return None if found[0] is None else found[0].arrays["numbers"].tolist(), found[1]


def test_a_successor_goes_on_from_the_newest_and_late_writes_of_a_former_owner_change_nothing(
    database: Postgresql, bucket: str, folder: ObjectFolder
) -> None:
    first = objects(database, bucket, folder, claimed(database, bucket))
    assert first.newest() == (None, [])
    for number in (1.0, 2.0, 3.0):
        assert first.write(snapshot(number)) > 0
    assert len(folder.names(bucket)) == checkpoint_objects.KEPT
    claim = claimed(database, bucket, B)
    assert (claim.epoch, claim.checkpoint, claim.object) == (2, b"", folder.names(bucket)[-1])
    with pytest.raises(CheckpointError, match="another process owns the bucket"):
        first.write(snapshot(4.0))
    late = f"{bucket}/{1:012d}-{9:012d}-late"  # it froze after it had written, and before it asked the database
    folder.write(late, [b"late"])
    second = objects(database, bucket, folder, claim)
    assert numbers(second.newest()) == ([3.0], [])
    for number in (5.0, 6.0):
        second.write(snapshot(number))
    assert [name.split("/")[1][:12] for name in folder.names(bucket)] == ["000000000002"] * checkpoint_objects.KEPT
    folder.write(late, [b"late"])
    third = claimed(database, bucket)
    assert numbers(objects(database, bucket, folder, third).newest()) == ([6.0], [])
    with connect(database.url(), "status") as connection:
        status = next(each for each in leases.status(connection) if each.lease.bucket == bucket)
    assert (status.lease.layout, status.checkpoint_bytes) == ("layout", len(folder.read(third.object) or b""))
    first.close()
    second.close()


def test_a_missing_or_damaged_object_costs_the_time_since_the_one_before(
    database: Postgresql, bucket: str, folder: ObjectFolder
) -> None:
    kept = objects(database, bucket, folder, claimed(database, bucket))
    for number in (1.0, 2.0):
        kept.write(snapshot(number))
    kept.close()
    claim = claimed(database, bucket, B)
    older, named = folder.names(bucket)
    whole = folder.read(named) or b""
    folder.write(named, [whole[:-1]])
    assert numbers(objects(database, bucket, folder, claim).newest()) == (
        [1.0],
        [f"{named} is not used: it is damaged (its checksum is wrong)"],
    )
    folder.delete(named)
    folder.delete(older)
    assert numbers(objects(database, bucket, folder, claim).newest()) == (
        None,
        [f"{named} is not used: {folder.url} does not have it"],
    )


def test_checkpoints_go_on_when_they_move_from_the_database_into_a_folder(
    database: Postgresql, bucket: str, tmp_path: Path
) -> None:
    before = row(database, bucket, claimed(database, bucket))
    before.write(snapshot(1.0))
    before.close()
    after = objects(database, bucket, ObjectFolder(f"file://{tmp_path}"), claimed(database, bucket, B))
    assert numbers(after.newest()) == ([1.0], [])
    after.write(snapshot(2.0))
    after.close()
    claim = claimed(database, bucket)
    assert claim.checkpoint == b""
    back = row(database, bucket, claim)
    assert back.newest() == (None, [f"the checkpoint {claim.object} is not used: cluster.checkpoints is not set"])
    back.write(snapshot(3.0))
    back.close()
    assert claimed(database, bucket, B).object == ""


def test_a_store_that_does_not_answer_is_asked_again_and_then_named(
    database: Postgresql, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoint_objects, "READ_S", 0.0)
    monkeypatch.setattr(checkpoint_objects, "RETRY_S", 0.0)
    with running_s3() as server:
        folder = ObjectFolder(server.url)
        kept = objects(database, bucket, folder, claimed(database, bucket))
        kept.write(snapshot(1.0))
        server.stop()
        with pytest.raises(CheckpointError, match=f"{server.url} does not take it"):
            kept.write(snapshot(2.0))
        kept.close()
        claim = claimed(database, bucket, B)
        found, complaints = objects(database, bucket, folder, claim).newest()
    assert found is None
    assert [text.partition(": ")[0] for text in complaints] == [f"the checkpoint {claim.object} is not used"]


def test_a_url_that_nothing_reads_is_refused() -> None:
    with pytest.raises(CheckpointError, match="nothing://x cannot be used"):
        ObjectFolder("nothing://x")
