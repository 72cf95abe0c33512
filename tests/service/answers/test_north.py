"""What several tags say about north, together."""

import math

import numpy as np
import pytest

from dropanchor_schemas.north import SiteNorth
from dropanchor_schemas.site import Site
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.north import SPREAD_STD, combined, north_error_of, site_north_of
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.store.norths import North


def answers_with(declination_rad: float, *norths: North) -> Answers:
    tags = TagTable()
    for number, north in enumerate(norths):
        tags.rows.norths.set(tags.register(f"tag-{number}").row, north)
    return Answers(SiteStore(Site(declination_rad=declination_rad), {}), tags, LatestPoses())


def test_the_tags_of_a_site_are_never_believed_to_differ_by_less_than_those_of_real_places() -> None:
    one = combined([North(0.5, 0.01)])
    many = combined([North(0.5, 0.01)] * 16)
    assert one is not None
    assert many is not None
    assert one.std_rad == pytest.approx(SPREAD_STD, rel=0.01)
    assert many.std_rad == pytest.approx(SPREAD_STD / 4.0, rel=0.01)


def test_tags_that_differ_by_more_are_counted_to_differ_by_more() -> None:
    alike, unlike = (combined([North(1.0 + d, 0.05), North(1.0 - d, 0.05)]) for d in (0.0, 0.5))
    assert alike is not None
    assert unlike is not None
    assert unlike.declination_rad == pytest.approx(1.0)
    assert unlike.std_rad == pytest.approx(0.5, rel=0.01)
    assert unlike.std_rad > 3.0 * alike.std_rad


def test_a_surer_tag_counts_more_and_angles_wrap() -> None:
    found = combined([North(math.pi - 0.1, 0.05), North(-math.pi + 0.1, 0.29)])
    assert found is not None
    assert math.pi - 0.1 < found.declination_rad < math.pi
    assert combined([]) is None


def test_a_claim_holds_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    inside = 0
    for _ in range(500):
        std = rng.uniform(0.05, 0.25, 4)
        told = 2.0 + rng.normal(0.0, SPREAD_STD, 4) + rng.normal(0.0, std)
        found = combined([North(*one) for one in zip(told.tolist(), std.tolist(), strict=True)])
        assert found is not None
        inside += abs(found.declination_rad - 2.0) < 1.96 * found.std_rad
    assert inside / 500 > 0.93


def test_north_is_offered_only_where_it_is_off_by_more_than_two_standard_deviations() -> None:
    for declination, offered in ((0.5, False), (0.31, False), (0.29, True), (-0.9, True)):
        answer = SiteNorth.model_validate(site_north_of(answers_with(declination, *[North(0.5, 0.1)] * 3)))
        assert answer.offered == offered
        assert answer.learned_rad == pytest.approx(0.5)
        assert [one.tag for one in answer.tags] == ["tag-0", "tag-1", "tag-2"]
        assert bool(answer.text) == bool(answer.phrase) == offered


def test_the_offer_names_how_many_tags_tell_it() -> None:
    three = site_north_of(answers_with(0.0, *[North(0.5, 0.1)] * 3))
    one = site_north_of(answers_with(0.0, North(0.5, 0.1)))
    assert three["text"].startswith("3 tags of this site")
    assert "29° ± 11° off" in three["text"]
    assert one["text"].startswith("A tag of this site")


def test_without_tags_that_know_nothing_is_learned() -> None:
    answer = SiteNorth.model_validate(site_north_of(answers_with(0.1)))
    assert (answer.declination_rad, answer.learned_rad, answer.std_rad, answer.offered) == (0.1, None, None, False)


def test_the_error_of_a_tag_counts_from_the_declination_of_its_site_and_goes_when_the_tag_does() -> None:
    answers = answers_with(0.2, North(0.5, 0.1))
    tag = answers.tags.all()[0]
    assert north_error_of(answers, tag) == {"error_rad": pytest.approx(0.3), "std_rad": 0.1}
    answers.forget(tag)
    assert north_error_of(answers, tag) is None
    assert site_north_of(answers)["tags"] == []
