"""A phone that opens the link of `dropanchor key add` becomes a tag with a pose."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

from dropanchor_schemas.wire import ENCODING_JSON, Frame, RangeSample, encode_json
from dropanchor_service.cli import main
from support.repeated import repeated
from support.service import Running, running_service, settings_file
from support.tag_page import tag_page
from support.zenoh_router import free_port, wait_until

pytestmark = pytest.mark.browser

START_Y, SPEED_MPS = -20.0, 1.0


def range_m(seconds: float) -> float:
    """Return the range to the anchor of a tag that walks north from (10, -20)."""
    return math.hypot(10.0, START_Y + SPEED_MPS * seconds)


@contextmanager
def ranges_from_elsewhere(service: Running, key: str) -> Iterator[None]:
    """Post ten ranges a second to anchor 7, as a gateway does, until the block ends."""
    headers = {"authorization": f"Bearer {key}", "content-type": ENCODING_JSON}
    begun_s = time.monotonic()

    def post(index: int) -> None:
        sample = RangeSample(time.time_ns(), 7, range_m(time.monotonic() - begun_s), 0.1)
        content = encode_json(Frame(ranges=[sample], sequence=index, boot_id=7))
        service.ask("POST", "/api/v1/ingest/samples", content=content, headers=headers)

    with repeated(post, 0.1):
        yield


def test_a_phone_that_opens_the_link_of_its_key_has_a_pose(
    chromium: Browser, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    security, port, http_port = tmp_path / "security", free_port(), free_port()

    def run(*words: str) -> tuple[str, str]:
        assert main([*words, "--security", str(security)]) == 0
        printed = capsys.readouterr()
        return printed.out.strip(), printed.err

    run("security", "init", "--host", "localhost", "--listen", f"tls/127.0.0.1:{port}")
    secret, told = run("key", "add", "phone", "--tag", "anna", "--url", f"https://localhost:{http_port}")
    link = told.partition("or open: ")[2].split()[0]
    gateway, reader = run("key", "add", "gateway", "--tag", "anna")[0], run("key", "add", "reader")[0]
    options = ("--security", str(security), "--zenoh-listen", f"tls/127.0.0.1:{port}", "--log-level", "DEBUG")
    config = ("--config", str(settings_file(tmp_path, ["anna"])), "--port", str(http_port))

    def tracked() -> dict[str, Any]:
        """Return the pose if it is tracked, otherwise nothing."""
        pose = service.ask("GET", "/api/v1/tags/anna/pose", headers={"authorization": f"Bearer {reader}"}).json()
        return pose if pose.get("state") == "tracking" else {}

    with running_service(*options, *config, ca=security / "ca.pem") as service:
        with tag_page(chromium, link, ignore_https_errors=True) as page, ranges_from_elsewhere(service, gateway):
            page.start()
            page.move(shake=0.8)
            # A phone that only trembles does not tell whether it moves: some seconds later its place is in doubt.
            pose = wait_until(tracked)
            page.wait_for("document.getElementById('state').textContent === 'Tracking'")
            page.wait_for("counts.sent > 600")
            assert page.errors == []
        assert service.stop() == 0
    assert pose["anchor"] == "7"
    assert math.hypot(pose["x"], pose["y"]) == pytest.approx(pose["range_m"], abs=2.0)
    assert math.remainder(pose["heading_rad"] - math.pi / 2, math.tau) == pytest.approx(0.0, abs=0.6)
    log = "".join(service.log)
    assert secret.split("_", 2)[2] not in log
