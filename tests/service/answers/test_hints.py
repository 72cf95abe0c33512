"""The hints that people get about a state."""

import pytest

from dropanchor_schemas import Pose
from dropanchor_schemas.pose import StateReason as ReasonName
from dropanchor_service.answers.columns import HINTS, REASONS
from dropanchor_service.estimation.columns import StateReason


def test_the_contract_has_exactly_the_reasons_of_the_engines() -> None:
    assert [reason.value for reason in ReasonName] == REASONS
    schema = Pose.model_json_schema()
    assert schema["$defs"]["StateReason"]["enum"] == REASONS


@pytest.mark.parametrize("reason", [reason for reason in StateReason if reason is not StateReason.RESOLVED])
def test_the_hint_of_every_problem_is_a_sentence_that_says_what_to_do(reason: StateReason) -> None:
    hint = HINTS[reason]
    assert hint[0].isupper()
    assert hint[-1] in ".?"
    assert len(hint) < 140


def test_a_good_pose_has_no_hint() -> None:
    assert HINTS[StateReason.RESOLVED] == ""
