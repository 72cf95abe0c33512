"""What the code host and the tools of contributors read is valid."""

from pathlib import Path

import pytest
import yaml

from support.commands import python
from support.service import ROOT

FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))


def is_valid(form: Path) -> bool:
    checked = python("-m", "check_jsonschema", "--builtin-schema", "vendor.github-issue-forms", str(form))
    return checked.returncode == 0


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.stem)
def test_a_form_for_issues_is_valid(form: Path) -> None:
    assert is_valid(form)


def test_an_invalid_form_is_noticed(tmp_path: Path) -> None:
    wrong = tmp_path / "bug.yml"
    wrong.write_text(FORMS[0].read_text().replace("type: textarea", "type: textfield", 1))
    assert not is_valid(wrong)


def test_the_hook_runs_the_check_and_loads_nothing() -> None:
    repositories = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert [repository["repo"] for repository in repositories] == ["local"]
    assert [hook["entry"] for hook in repositories[0]["hooks"]] == ["make check"]
