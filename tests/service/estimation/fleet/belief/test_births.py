"""The births of hypotheses: the table is whole, and each birth can be switched off."""

import re
from pathlib import Path

import numpy as np
import pytest

import dropanchor_service
from dropanchor_service.estimation.fleet.belief.births import numbers
from dropanchor_service.estimation.fleet.belief.births.forgetting import MISFIT, PLACE, SIGHT, TRACK, forget
from dropanchor_service.estimation.fleet.belief.births.numbers import NAMES, NoBirthError, without
from dropanchor_service.estimation.fleet.belief.layout import ROW
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.tuning import Tuning
from replay.outputs import replay_with

NEEDED = [
    *(("given-start", "straight"), ("own-error", "straight"), ("ring", "unknown_start")),
    *(("sight-lost", "nlos"), ("split-wide", "unknown_start"), ("turned-after-stop", "stop_and_go")),
]


def test_every_birth_has_a_number_and_a_row_in_the_table_of_the_documentation() -> None:
    table = Path(dropanchor_service.__file__).parents[1] / "docs/reference/births.md"
    assert re.findall(r"^\| `([a-z-]+)` \|", table.read_text(), re.MULTILINE) == list(NAMES)
    assert NAMES[numbers.FIX] == "fix"
    assert len(set(NAMES)) == numbers.FIX + 1


def test_births_are_on_unless_somebody_switches_them_off_by_name() -> None:
    assert Tuning().births == without() == numbers.ALL
    assert without("ring", "sight-lost") == numbers.ALL - (1 << numbers.RING) - (1 << numbers.SIGHT_LOST)
    with pytest.raises(NoBirthError, match=r"no birth is named 'rings'; take one of given-start, ring, "):
        without("rings")


@pytest.mark.parametrize(("birth", "replay"), NEEDED)
def test_an_engine_runs_without_a_birth_and_another_way(birth: str, replay: str) -> None:
    complete, other = (
        replay_with(FleetEngine(), replay),
        replay_with(FleetEngine(Tuning(births=without(birth))), replay),
    )
    assert len(complete) == len(other) > 100
    assert not np.array_equal(complete, other, equal_nan=True)


def test_a_row_forgets_the_parts_that_it_is_told_to_forget_and_no_others() -> None:
    row = np.ones(1, ROW)[0]
    forget(row, SIGHT)
    assert (row["nlos"]["high_run"], row["nlos"]["misfit"], row["nlos"]["widened"]) == (0, 0.0, 0)
    assert (row["publication"]["resolved"], row["start"]["known"], row["walk"]["carried"]) == (1, 1, 1)
    forget(row, PLACE)
    assert (row["start"]["known"], row["start"]["after_gap"]) == (0, 0)
    forget(row, TRACK)
    assert (row["publication"]["resolved"], row["walk"]["carried"], row["heading"]["models_started"]) == (0, 0, 0)
    assert TRACK & MISFIT
