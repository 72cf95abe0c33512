"""Whether an owner may go on: by a clock that the test moves."""

from dropanchor_service.cluster.tenure import GIVE_UP_S, HAND_OVER_S, Standing, Tenure


class Owner:
    """A tenure of epoch 5 with a lease of 2 s, in a process that ticks every 0.1 s while it runs."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.hears_others = True
        self.tenure = Tenure(5, 2.0, lambda: self.now_s, lambda: self.hears_others, asked_s=self.now_s)

    def runs(self, seconds: float) -> Standing:
        for _ in range(round(seconds * 10)):
            self.now_s += 0.1
            self.tenure.tick()
        return self.tenure.standing

    def is_frozen(self, seconds: float) -> Standing:
        self.now_s += seconds
        return self.tenure.standing


def test_an_owner_whose_database_is_away_goes_on_until_it_sees_a_higher_epoch() -> None:
    owner = Owner()
    assert owner.runs(1.9) is Standing.OWNER
    assert owner.runs(3600.0) is Standing.ALONE
    assert owner.tenure.may_serve
    owner.tenure.saw_epoch(4)
    owner.tenure.saw_epoch(5)
    assert owner.tenure.may_serve
    owner.tenure.saw_epoch(6)
    assert owner.tenure.standing is Standing.LOST
    assert owner.tenure.why_lost == "an owner with the higher epoch 6 is alive"


def test_while_the_database_renews_the_lease_a_token_changes_nothing() -> None:
    owner = Owner()
    owner.tenure.saw_epoch(99)
    for _ in range(10):
        assert owner.runs(1.0) is Standing.OWNER
        owner.tenure.renewed(owner.now_s)


def test_an_owner_that_would_not_hear_of_another_one_is_silent_until_it_would() -> None:
    owner = Owner()
    owner.hears_others = False
    assert owner.runs(1.9) is Standing.OWNER
    assert owner.runs(0.3) is Standing.IN_DOUBT
    owner.hears_others = True
    assert owner.runs(0.1) is Standing.ALONE


def test_an_owner_that_was_frozen_is_silent_at_once_and_until_the_database_has_renewed_its_lease() -> None:
    owner = Owner()
    owner.runs(0.5)
    assert owner.is_frozen(20.0) is Standing.IN_DOUBT
    assert owner.runs(1.0) is Standing.IN_DOUBT
    assert not owner.tenure.may_serve
    owner.tenure.renewed(owner.now_s)
    assert owner.tenure.standing is Standing.OWNER


def test_the_lease_counts_from_the_request_that_renewed_it() -> None:
    owner = Owner()
    asked_s = owner.now_s
    owner.runs(1.5)
    owner.tenure.renewed(asked_s)
    assert owner.runs(0.6) is Standing.ALONE


def test_an_owner_in_doubt_gives_up_when_the_database_does_not_answer() -> None:
    owner = Owner()
    owner.is_frozen(5.0)
    assert owner.runs(GIVE_UP_S + 0.2) is Standing.LOST
    assert "the database has not answered" in owner.tenure.why_lost


def test_a_short_pause_within_the_lease_is_no_doubt() -> None:
    owner = Owner()
    assert owner.is_frozen(1.9) is Standing.OWNER
    assert owner.runs(1.0) is Standing.ALONE


def test_an_owner_that_hands_over_serves_until_its_successor_is_there_but_not_for_ever() -> None:
    for ends_early in (True, False):
        owner = Owner()
        owner.tenure.hand_over()
        assert owner.runs(HAND_OVER_S - 1.0) is Standing.LEAVING
        assert owner.tenure.may_serve
        if ends_early:
            owner.tenure.saw_epoch(6)
            assert owner.tenure.standing is Standing.LOST
        else:
            assert owner.runs(1.2) is Standing.LOST
