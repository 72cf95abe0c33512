"""`make check` compares the page's modules with the types in their comments."""

import json
from pathlib import Path

import pytest

from support import page_types

RIGHT = "/** @param {number} side */\nexport const area = (side) => side * side;\n"
MODULES = {
    "right.js": RIGHT,
    "wrong.js": f'{RIGHT}area("2");\n',
    "missing.js": f"{RIGHT}export const half = (side) => side / 2;\n",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project of the modules beside it, with the options of the page's own."""
    problem = page_types.problem_of_compiler(page_types.FOLDER)
    if problem is not None:
        pytest.skip(problem)
    path = tmp_path / "tsconfig.json"
    options = {"lib": ["ES2023"]}  # these modules need no browser, whose types take the compiler two seconds
    path.write_text(json.dumps({"extends": str(page_types.PROJECT), "compilerOptions": options, "include": ["*.js"]}))
    return path


def test_a_module_with_a_wrong_or_missing_type_is_named(project: Path) -> None:
    for name, text in MODULES.items():
        (project.parent / name).write_text(text)
    errors = page_types.errors_in(project, page_types.FOLDER)
    assert {line.partition(",")[0].rpartition("/")[2] for line in errors.splitlines()} == {"wrong.js(3", "missing.js(3"}
    for name in ("wrong.js", "missing.js"):
        (project.parent / name).write_text(RIGHT)
    assert page_types.errors_in(project, page_types.FOLDER) == ""


def test_without_npm_and_node_the_check_says_so_and_passes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(page_types, "FOLDER", tmp_path / "typescript")
    assert page_types.main() == 0
    assert "npm and node are not installed" in capsys.readouterr().err
