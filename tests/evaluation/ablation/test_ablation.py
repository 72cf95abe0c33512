"""Rules of the engine, each of which can be taken out."""

import importlib
import os
from pathlib import Path

import pytest

from dropanchor_evaluation.ablation import work
from dropanchor_evaluation.ablation.report import effect, gathered, markdown, without_effect
from dropanchor_evaluation.ablation.rules import RULES, NoRuleError, Rule, selected
from dropanchor_evaluation.ablation.work import Outcome, Trial, run_trial
from dropanchor_evaluation.product.rows import Row, simulated_rows
from dropanchor_evaluation.product.rows import selected as selected_rows
from dropanchor_evaluation.product.runs import sources, tag_run
from dropanchor_evaluation.product.scores import TagScore
from dropanchor_evaluation.product.work import Task, run_row
from dropanchor_service.cli import main
from dropanchor_service.estimation.fleet.tuning import Tuning

ROW = Row("S5", "scalar", "everything", "known")


@pytest.mark.parametrize("rule", RULES, ids=[rule.name for rule in RULES])
def test_a_rule_is_taken_out_by_numbers_that_the_engine_has(rule: Rule, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rule.numbers or rule.births
    if rule.tuning or rule.births:
        assert rule.tuned() != Tuning()
    for name, value in rule.constants.items():
        module, _, constant = name.partition(":")
        place = importlib.import_module(f"dropanchor_service.estimation.fleet.{module}")
        before = getattr(place, constant)
        assert before != value
        monkeypatch.setattr(place, constant, before)  # so that it comes back
    rule.take_constants_out()
    for name, value in rule.constants.items():
        module, _, constant = name.partition(":")
        assert getattr(importlib.import_module(f"dropanchor_service.estimation.fleet.{module}"), constant) == value


def test_simulated_rows_exist_that_a_rule_was_made_for() -> None:
    for rule in RULES:
        if not rule.births and "recorded" not in rule.made_for:
            assert selected_rows(simulated_rows(), [rule.made_for])


def test_all_rules_give_what_product_gives_and_a_rule_out_gives_something_else() -> None:
    (rule,) = selected(["tempered likelihood of ranges"])
    seeds = range(5000, 5002)
    usual, without = run_trial(Trial(Task((ROW,), seeds), (None, rule)))
    tags = [tag_run(ROW, one) for one in sources(ROW, seeds)]
    assert usual.tags == run_row(ROW, tags).tags
    assert [one.rmse for one in without.tags] != [one.rmse for one in usual.tags]


def test_processes_that_start_without_a_rule_share_no_compiled_code_with_others(tmp_path: Path) -> None:
    before = os.environ.get(work.CACHE)
    with work.compiled_into(str(tmp_path)):
        assert os.environ[work.CACHE] == str(tmp_path)
    assert os.environ.get(work.CACHE) == before


def _tag(second_half: float, sigma: float, tracking: float = 1.0) -> TagScore:
    return TagScore("1", 1.0, second_half, 1.0, 1.0, 0.0, tracking, 10, 10, sigma)


def test_a_rule_buys_what_gets_worse_without_it() -> None:
    good, bad, lying = [_tag(0.5, 1.0)] * 10, [_tag(0.6, 1.0)] * 10, [*[_tag(0.5, 1.0)] * 9, _tag(0.5, 7.0)]
    names = ("hysteresis of modes", "place walks", "speed walks")
    tags = gathered(
        [Outcome(None, ROW, good), *(Outcome(n, ROW, t) for n, t in zip(names, (bad, lying, good), strict=True))]
    )
    assert effect(tags, names[0], [ROW]).median == pytest.approx(1.2)
    assert effect(tags, names[1], [ROW]).lies_without == 1
    assert without_effect(tags) == ["speed walks"]
    text = markdown(tags, selected(names), range(5000, 5010))
    assert "| hysteresis of modes | +20.0% / +20.0% | +20% S5/scalar/everything/known | 0 → 0 |" in text
    assert text.count("nothing that can be seen") == 1


def test_a_pattern_without_a_rule_is_refused() -> None:
    with pytest.raises(NoRuleError, match="--list prints all rules"):
        selected(["no such rule"])


def test_the_command_lists_the_rules_and_prints_their_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "ablate", "--list"]) == 0
    assert "place walks" in capsys.readouterr().out
    options = ["--rules", "outliers of ranges", "--rows", "S5/scalar/everything/known", "--seeds", "5000-5001"]
    assert main(["evaluate", "ablate", *options, "--processes", "1"]) == 0
    out = capsys.readouterr().out
    assert "| outliers of ranges |" in out
    assert "Without an effect that can be seen:" in out
    assert main(["evaluate", "ablate", "--rules", "nothing"]) == 2
