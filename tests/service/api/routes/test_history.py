"""What cannot be read of a history is the same problem at each of its routes."""

from pathlib import Path

import pytest

from service.api.routes.test_track import driven
from support.api import ask, kind_of, make_api_bench


@pytest.mark.parametrize("path", ["tracks", "figures", "heat-map", "tags/a/track"])
def test_a_missing_history_too_much_of_it_and_a_damaged_one_are_different_problems(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, path = driven(tmp_path), f"/api/v1/{path}"
    assert kind_of(ask(make_api_bench().app(), "GET", path)) == "no-history"
    if not path.endswith("/track"):  # which comes in pages
        monkeypatch.setattr("dropanchor_service.history.overview.MAX_POSES", 0)
        monkeypatch.setattr("dropanchor_service.history.covering.MAX_BYTES", -1)
        refused = ask(bench.app(), "GET", path)
        assert (kind_of(refused), "name the tags" in refused.text) == ("invalid-request", True)
    for file in tmp_path.glob("history.sqlite*"):
        file.write_bytes(b"torn " * 1000)
    assert kind_of(ask(bench.app(), "GET", path)) == "history-unreadable"


def test_the_track_of_an_unknown_tag_is_not_found(tmp_path: Path) -> None:
    assert kind_of(ask(driven(tmp_path).app(), "GET", "/api/v1/tags/nobody/track")) == "unknown-tag"
