"""Level scalars that the project's simulator did not make, with ranges at 10 and 100 Hz. Only the start is told."""

import pytest

from dropanchor_evaluation.product.scores import summary
from dropanchor_evaluation.product.work import score_tags
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.level_scalars import level_scalars


@pytest.mark.parametrize("range_hz", [10, 100])
@pytest.mark.parametrize("kind", ["C5", "M5"])
def test_no_tag_of_another_generator_is_surely_in_the_wrong_place(kind: str, range_hz: int) -> None:
    tags, _ = score_tags(FleetEngine(), [level_scalars(kind, seed, range_hz) for seed in range(5000, 5008)])
    score = summary(tags, us=0.0)
    assert score.worst_sigma < 5.0  # at 100 Hz, before: 15 and 16, and mirror images past the anchor
    assert score.coverage > 0.93
    assert score.tracking_share > 0.8
