"""What a human is told about a state."""

import pytest

from dropanchor_schemas import Pose
from dropanchor_schemas.pose import StateReason as ReasonName
from dropanchor_service.answers.columns import HINTS, REASONS
from dropanchor_service.estimation.columns import StateReason


def test_the_contract_names_the_reasons_of_the_engines_and_no_other() -> None:
    assert [reason.value for reason in ReasonName] == REASONS
    schema = Pose.model_json_schema()
    assert schema["$defs"]["StateReason"]["enum"] == REASONS


@pytest.mark.parametrize("reason", [reason for reason in StateReason if reason is not StateReason.RESOLVED])
def test_every_reason_that_is_a_trouble_says_in_a_sentence_what_to_do(reason: StateReason) -> None:
    hint = HINTS[reason]
    assert hint[0].isupper()
    assert hint[-1] in ".?"
    assert len(hint) < 140


def test_a_pose_that_is_good_asks_for_nothing() -> None:
    assert HINTS[StateReason.RESOLVED] == ""
