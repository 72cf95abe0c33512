"""The publishing path stays light: it loads none of the heavy modules."""

import pytest

from support.commands import python
from support.zenoh_router import free_endpoint, running_router

HEAVY = (
    *("numpy", "pydantic", "pydantic_core", "fastapi", "dropanchor_service", "lzma", "dropanchor_tag_client.spool"),
    *("dataclasses", "inspect", "difflib"),  # over 1 MB
)
PUBLISH = """
import sys
from dropanchor_tag_client import TagClient
with TagClient("a", connect=sys.argv[1], encoding=sys.argv[2]) as tag:
    tag.publish_range("L0", 1.0)
    tag.publish_imu((0, 0, 9.8), (0, 0, 0))
print(*sys.modules)
"""


def heavy_in(modules: str) -> set[str]:
    assert "zenoh" in modules.split()
    return set(HEAVY) & set(modules.split())


@pytest.mark.parametrize("encoding", ["packed", "json"])
def test_publishing_loads_none_of_them(encoding: str) -> None:
    endpoint = free_endpoint()
    with running_router(endpoint):
        done = python("-c", PUBLISH, endpoint, encoding)
    assert done.returncode == 0, done.stderr
    assert heavy_in(done.stdout) == set()


@pytest.mark.parametrize("source", ["replay", "publish", "serial", "mqtt", "imu"])
def test_the_commands_of_live_tags_and_replays_load_none_of_them(source: str) -> None:
    allowed = {"lzma", "dataclasses", "inspect"} if source in ("replay", "mqtt") else set()  # gzip of recordings; paho
    done = python(
        "-c", f"import sys\nfrom dropanchor_tag_client.cli import parser\nparser({source!r})\nprint(*sys.modules)"
    )
    assert done.returncode == 0, done.stderr
    assert heavy_in(done.stdout) <= allowed
