"""The modules of the contract that a tag imports need only the standard library."""

import pytest

from support.commands import python


def loaded_by(statement: str) -> set[str]:
    done = python("-c", f"{statement}\nimport sys\nprint(*sys.modules)")
    assert done.returncode == 0, done.stderr
    return {name.partition(".")[0] for name in done.stdout.split()}


@pytest.mark.parametrize("module", ["wire", "keys", "file_names"])
def test_the_publishing_path_imports_neither_pydantic_nor_numpy(module: str) -> None:
    loaded = loaded_by(f"import dropanchor_schemas.{module}")
    assert "dropanchor_schemas" in loaded
    assert not loaded & {"pydantic", "pydantic_core", "numpy", "zenoh"}
