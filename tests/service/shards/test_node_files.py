"""What a node refuses before it starts Ray, and what it starts Ray with."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from dropanchor_service.cli import main
from dropanchor_service.commands import cluster_start
from dropanchor_service.shards.node_lock import node_lock, running_node
from dropanchor_service.shards.ray_node import RayNode, ray_settings
from dropanchor_service.shards.token_file import TokenError, made_or_read
from support.cluster import needs_ray

URL = "postgresql://dropanchor@127.0.0.1:9/none"


def test_the_head_makes_a_token_that_nobody_else_reads_and_others_need_it(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "token"
    with pytest.raises(TokenError, match=r"there is no token at .*: copy the one of the head"):
        made_or_read(path, may_make=False)
    assert made_or_read(path, may_make=True) == path
    assert path.stat().st_mode & 0o777 == 0o600
    text = path.read_text()
    assert len(text.strip()) == 64
    assert made_or_read(path, may_make=True).read_text() == text
    path.chmod(0o640)
    with pytest.raises(TokenError, match="others may read the token"):
        made_or_read(path, may_make=True)
    path.chmod(0o600)
    path.write_text("secret\n")
    with pytest.raises(TokenError, match="is too short"):
        made_or_read(path, may_make=False)


def test_a_folder_is_of_one_node_and_knows_its_process(tmp_path: Path) -> None:
    assert running_node(tmp_path) is None
    with node_lock(tmp_path):
        owner = running_node(tmp_path)
        assert owner is not None
        assert owner.pid == os.getpid()
        with pytest.raises(ValueError, match=f"a node runs already: {tmp_path} is in use by process {os.getpid()} on "):
            node_lock(tmp_path)
    assert running_node(tmp_path) is None


def test_ray_gets_a_token_no_dashboard_and_no_statistics(tmp_path: Path) -> None:
    settings = ray_settings(tmp_path / "token")
    assert (settings["RAY_AUTH_MODE"], settings["RAY_USAGE_STATS_ENABLED"]) == ("token", "0")
    head = RayNode("m", tmp_path, "10.0.0.1", None, 6379, 0).command("")
    assert {"--head", "--include-dashboard=false", "--disable-usage-stats", "--block"} <= set(head)
    node = RayNode("m", tmp_path, "10.0.0.2", "", 6379, 4).command("10.0.0.1:6379")
    assert node[node.index("--address") + 1] == "10.0.0.1:6379"
    assert node[node.index("--resources") + 1] == '{"shard": 4}'


@needs_ray
@pytest.mark.parametrize(
    ("settings", "options", "sentence"),
    [
        ("", ["--head"], "cluster.url: set the PostgreSQL database of the cluster"),
        (f'url = "{URL}"\nbucket = "b"', ["--head"], "the processes need one router that outlives them"),
        (f'url = "{URL}"\nname = "a/b"\nZENOH', ["--head"], "cluster.name: 'a/b' cannot name a node"),
        (f'url = "{URL}"\nZENOH', ["--head", f"--folder=/{'x' * 60}"], "is too long for Ray's sockets"),
        (f'url = "{URL}"\nZENOH', ["--head", "--shards=-1"], "--shards: 0 or more"),
        (f'url = "{URL}"\nZENOH', ["--join"], "there is no token at"),
        (f'url = "{URL}"\nZENOH', ["--head"], "the database does not answer as expected"),
    ],
)
def test_a_node_that_cannot_start_says_why(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    settings: str,
    options: list[str],
    sentence: str,
) -> None:
    monkeypatch.setattr(cluster_start, "_set_up_ray", lambda *_: None)  # it would set variables of this process
    zenoh = '[zenoh]\nconnect = ["tcp/127.0.0.1:7447"]\n[sites."001.a"]'
    config = tmp_path / "yards.toml"
    config.write_text(f"[cluster]\n{settings.replace('ZENOH', zenoh)}\n")
    with TemporaryDirectory(dir="/tmp") as short:
        assert main(["cluster", "start", f"--config={config}", f"--folder={short}", *options]) == 2
    assert sentence in capsys.readouterr().err
