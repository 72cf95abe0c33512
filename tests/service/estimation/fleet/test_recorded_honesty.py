"""The whole engine on recordings with ground truth: what `tracking` promises on data that no simulator made."""

import pytest

from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.runs import sources, tag_run
from dropanchor_evaluation.product.work import run_row
from support.recordings import recording_or_skip

pytestmark = pytest.mark.recordings


@pytest.mark.parametrize(
    "name",  # measured: 0.96, 0.96, 0.97, 0.89, 0.91, 0.96, 0.96, 0.97
    [
        "hanyang_losB4",
        "hanyang_nlosA2",
        "iasl_s1",
        "iasl_s3",
        "mower",
        "plaza2",
        "starloc_fast_s1_tag1",
        "starloc_fast_s1_tag2",
    ],
)
def test_the_ellipse_holds_the_truth_where_the_operator_told_what_could_be_known(name: str) -> None:
    row = Row(name, "recorded", "operator", "known", (recording_or_skip(name),))
    assert run_row(row, [tag_run(row, one) for one in sources(row, [])]).score.coverage > 0.85


@pytest.mark.parametrize("kind", ["front", "rot"])
def test_no_walk_with_a_held_phone_is_surely_in_the_wrong_place(kind: str) -> None:
    folders = tuple(recording_or_skip(f"phones/ms{walk:02}_{kind}") for walk in range(8))
    row = Row(f"phones-{kind}", "recorded", "nothing", "known", folders)
    score = run_row(row, [tag_run(row, one) for one in sources(row, [])]).score
    assert score.worst_sigma < 5.0  # before: 9.5 and 7.0, where a first step was not seen
    assert score.coverage > 0.93
