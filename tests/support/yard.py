"""A real service for what reads it from outside: a site with a georeference, a history and a tag that went by."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dropanchor_schemas.wire import ENCODING_JSON, encode_json
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import wait_until


@contextmanager
def running_yard(folder: Path, tag: str, more: str = "") -> Iterator[Running]:
    """Run the service until the block ends. Its tag has poses and a stored track, and is silent by now.

    more: settings.
    """
    config = settings_file(folder, [tag], f"[site.georeference]\nlat = 52.5\nlon = 13.4\nalt_m = 34.0\n{more}")
    with running_service("--config", str(config), "--data-dir", str(folder)) as running:
        samples, content_type = encode_json(straight_north(100)), {"content-type": ENCODING_JSON}
        sent = running.ask("POST", f"/api/v1/ingest/samples?tag={tag}", content=samples, headers=content_type)
        assert sent.status_code == 202, sent.text
        wait_until(lambda: _stored(running, tag) > 8)
        yield running


def _stored(running: Running, tag: str) -> int:
    track = running.ask("GET", f"/api/v1/tags/{tag}/track")
    return len(track.json()["poses"]) if track.is_success else 0  # there is no file before the first write
