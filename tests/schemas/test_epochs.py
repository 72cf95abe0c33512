"""A reader drops poses of former owners, site by site."""

from dropanchor_schemas import keys
from dropanchor_schemas.epochs import EpochFence


def test_a_lower_epoch_than_the_highest_of_the_site_is_dropped() -> None:
    fence = EpochFence()
    seen = [("yard", 0), ("yard", 3), ("yard", 2), ("yard", 3), ("mill", 1), ("yard", 4), ("yard", 3), ("mill", 1)]
    assert [fence.accepts(*each) for each in seen] == [True, True, False, True, True, True, False, True]


def test_the_key_of_an_owner_holds_its_epoch_and_is_of_no_site() -> None:
    key = keys.owner_key("yard/1", 12)
    assert key == "dropanchor/@v1/@owner/yard%2F1/12"
    assert keys.epoch_from_key(key) == 12
    assert keys.chunk_from_id("@owner") != "@owner"
    for other in (keys.owner_key("yard", 12) + "x", "dropanchor/@v1/@owner/yard/-1", ""):
        assert keys.epoch_from_key(other) is None
