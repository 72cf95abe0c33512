"""The page that makes a phone a tag, in a real browser against the real interface."""

import json
import math
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import zxingcpp
from playwright.sync_api import Browser

from support.axe import violations
from support.relay import running_relay
from support.tag_page import APPLE, SERIAL, TagPage, tag_page
from support.tag_page_service import Service

pytestmark = pytest.mark.browser

SECOND = 1_000_000_000
STORED = """new Promise((resolve) => {
    const asked = indexedDB.open("dropanchor-tag-anna");
    asked.onsuccess = () => {
        const found = asked.result.transaction("messages").objectStore("messages").getAll();
        asked.result.close();
        found.onsuccess = () => resolve(found.result.reduce((sum, { samples }) => sum + samples, 0));
    };
})"""
"""The samples that the page has stored."""


@pytest.fixture
def service(tmp_path: Path) -> Service:
    return Service(tmp_path)


def assert_nothing_is_missing(service: Service, page: TagPage) -> None:
    """Wait until all is answered, and check that every message arrived, in its order."""
    page.rest()
    page.wait_for("counts.waiting === 0 && counts.sent === counts.taken")
    assert page.counts()["lost"] == 0
    frames = service.frames()
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert len({frame.boot_id for frame in frames}) == 1
    times = [sample.t_ns for frame in frames for sample in frame.imu]
    assert times == sorted(set(times))
    assert len(times) == page.counts()["taken"]


def test_samples_arrive_with_the_units_and_axes_of_a_tag(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link) as page:
        page.start()
        page.move((1.0, 2.0, 9.5), (10.0, 20.0, 30.0))
        page.wait_for("counts.sent > 60")
        assert page.text("screen") == "up"
        page.wait_for("Number(document.getElementById('rate').textContent) > 30")
        assert_nothing_is_missing(service, page)
        assert page.errors == []
    sample = service.frames()[0].imu[0]
    assert sample.acc == pytest.approx((2.0, -1.0, 9.5), abs=1e-6)
    assert sample.gyro == pytest.approx([math.radians(rate) for rate in (20.0, -10.0, 30.0)], abs=1e-6)
    assert sample.mag is None
    assert abs(sample.t_ns - time.time_ns()) < 60e9


def test_more_samples_at_once_than_a_payload_holds_become_several_messages(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link) as page:
        page.start()
        page.wait_for("dropanchor.status() === 'open'")
        page.page.evaluate("phone.report([0, 0, 9.81], [0, 0, 0], 0, 2500)")
        page.wait_for("counts.taken === 2500")
        assert_nothing_is_missing(service, page)
    assert len(service.frames()) == 3


def test_a_browser_of_apple_is_asked_in_the_tap_and_its_accelerations_are_turned_round(
    chromium: Browser, service: Service
) -> None:
    with service.running(), tag_page(chromium, service.link, APPLE % "granted") as page:
        page.start()
        page.move((1.0, 2.0, -9.5), (10.0, 20.0, 30.0))
        page.wait_for("counts.sent > 10")
        assert page.page.evaluate("asked") == 1
    sample = service.frames()[0].imu[0]
    assert sample.acc == pytest.approx((-2.0, 1.0, 9.5), abs=1e-6)
    assert sample.gyro == pytest.approx([math.radians(rate) for rate in (20.0, -10.0, 30.0)], abs=1e-6)


def test_a_person_who_does_not_allow_motion_reads_what_to_do(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link, APPLE % "denied") as page:
        page.start()
        page.wait_for("document.getElementById('problem').textContent.startsWith('Motion was not allowed.')")


def test_a_device_without_sensors_says_so(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link) as page:
        page.start()
        page.wait_for("document.getElementById('problem').textContent.startsWith('This device reports no motion')")


def test_an_outage_of_the_service_loses_nothing(chromium: Browser, service: Service) -> None:
    with ExitStack() as opened:
        with service.running():
            page = opened.enter_context(tag_page(chromium, service.link))
            page.start()
            page.move()
            page.wait_for("counts.sent > 30")
        page.wait_for("dropanchor.status() === 'broken' && counts.waiting > 900")
        assert "wait on this device" in page.text("problem")
        with service.running():
            page.wait_for("dropanchor.status() === 'open'")
            assert_nothing_is_missing(service, page)
            assert page.errors == []


def test_a_network_that_falls_silent_loses_nothing(chromium: Browser, service: Service) -> None:
    with service.running(), running_relay(service.port) as relay:
        link = service.link.replace(str(service.port), str(relay.port))
        with tag_page(chromium, link) as page:
            page.start()
            page.move()
            page.wait_for("counts.sent > 30")
            relay.silent.set()
            page.wait_for("dropanchor.status() !== 'open'")
            page.wait_for("counts.waiting > 300")
            relay.silent.clear()
            page.wait_for("dropanchor.status() === 'open'")
            assert_nothing_is_missing(service, page)


def test_what_waits_survives_a_reload_of_the_page(chromium: Browser, service: Service) -> None:
    with ExitStack() as opened:
        with service.running():
            page = opened.enter_context(tag_page(chromium, service.link))
            page.start()
            page.move()
            page.wait_for("counts.sent > 30")
        page.wait_for("counts.waiting > 60")
        page.rest()
        page.wait_for(
            f"counts.sent + counts.waiting === counts.taken && {STORED}.then((all) => all === counts.waiting)"
        )
        taken = page.counts()["taken"]
        with service.running():
            page.page.reload()
            page.wait_for("counts.waiting > 60")
            page.start()
            page.wait_for("counts.waiting === 0")
            assert service.imu_samples() == taken


def test_a_service_that_was_killed_gets_again_what_it_had_answered_just_before(
    chromium: Browser, service: Service
) -> None:
    with ExitStack() as opened:
        with service.running():
            page = opened.enter_context(tag_page(chromium, service.link))
            page.start()
            page.move()
            page.wait_for("counts.sent > 60")
        before, service.bench.received = service.bench.received, []
        with service.running():
            page.wait_for("dropanchor.status() === 'open' && counts.waiting < 20")
            assert set(before[-10:]) <= set(service.bench.received)
            service.bench.received[:0] = before  # in one step, since more arrive
            assert_nothing_is_missing(service, page)


@pytest.mark.parametrize(
    ("key", "tag", "sentence"),
    [
        ("dropanchor_no", "anna", "Not accepted: the API key is unknown or was revoked."),
        ("a wrong one", "anna", "This is not a key: it has characters that no key has."),
        ("", "anna", "This service needs a key. Make a key with dropanchor key add NAME --tag TAG."),
        (None, "bert", "This key speaks for the tag 'anna' only."),
    ],
)
def test_a_key_that_does_not_fit_gives_a_sentence(
    chromium: Browser, service: Service, key: str | None, tag: str, sentence: str
) -> None:
    with service.running(), tag_page(chromium, f"http://127.0.0.1:{service.port}/tag") as page:
        page.page.locator("#tag").fill(tag)
        page.page.locator("#key").fill(service.anna if key is None else key)
        page.page.keyboard.press("Enter")
        page.start()
        page.wait_for("dropanchor.status() === 'refused'")
        page.wait_for(f"document.getElementById('problem').textContent.startsWith({json.dumps(sentence)})")
        assert page.page.locator("#change").is_visible()


def test_the_key_stays_out_of_the_address_the_page_and_every_request_line(chromium: Browser, service: Service) -> None:
    urls: list[str] = []
    with service.running(), tag_page(chromium, service.link) as page:
        page.page.on("request", lambda request: urls.append(request.url))
        page.page.on("websocket", lambda socket: urls.append(socket.url))
        page.page.reload()
        page.start()
        page.wait_for("dropanchor.status() === 'open'")
        assert page.page.url == f"http://127.0.0.1:{service.port}/tag/"
        assert service.anna not in page.page.content()
        assert not any(service.anna in url for url in urls)
        assert page.page.evaluate("document.cookie + JSON.stringify({ ...localStorage })") == "{}"


def test_the_page_shows_the_state_of_the_tag_and_the_offset_of_its_clock(chromium: Browser, service: Service) -> None:
    ahead_ns, began_ns = 5 * SECOND, time.time_ns()
    service.bench.answers.now_ns = lambda: time.time_ns() + ahead_ns
    service.bench.move("anna", t_ns=time.time_ns() + ahead_ns)
    with service.running(), tag_page(chromium, service.link) as page:
        page.start()
        page.move()
        page.wait_for("document.getElementById('offset').textContent.endsWith('corrected')")
        assert 4500 < float(page.text("offset").split()[0]) < 5500
        assert page.text("state") in ("Tracking", "Coasting", "Lost")  # its pose ages
        sent = page.counts()["sent"]
        page.wait_for(f"counts.sent > {sent + 20}")
    assert began_ns < service.frames()[-1].imu[-1].t_ns - ahead_ns + SECOND < time.time_ns() + 2 * SECOND


PIXELS = """(image) => {
    const { naturalWidth: width, naturalHeight: height } = image;
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const red = context.getImageData(0, 0, width, height).data.filter((_, index) => index % 4 === 0);
    return { width, red: Array.from(red) };
}"""


def test_the_page_offers_the_experiment_for_phyphox(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link) as page:
        page.page.locator("#phyphox summary").click()
        page.wait_for("document.getElementById('phyphox-code').naturalWidth > 0")
        link = page.page.locator("#phyphox-link").get_attribute("href")
        pixels = page.page.locator("#phyphox-code").evaluate(PIXELS)
        assert page.errors == []
    address = f"127.0.0.1:{service.port}/api/v1/ingest/phyphox?tag=anna&token={service.anna}"
    assert link == f"phyphox://{address}"
    [found] = zxingcpp.read_barcodes(np.array(pixels["red"], np.uint8).reshape(-1, pixels["width"]))
    assert found.text == link


def test_after_stop_nothing_more_is_taken_and_the_rest_is_sent(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link) as page:
        page.start()
        page.move()
        page.wait_for("counts.sent > 10")
        page.page.locator("#toggle").click()
        page.wait_for("dropanchor.status() === 'closed' && counts.waiting === 0")
        taken = page.counts()["taken"]
        page.page.wait_for_timeout(300)
        assert page.counts()["taken"] == taken == service.imu_samples()


def test_the_page_has_no_accessibility_violation(chromium: Browser, service: Service, axe: str) -> None:
    with ExitStack() as opened:
        with service.running():
            with tag_page(chromium, f"http://127.0.0.1:{service.port}/tag") as page:
                page.page.locator("#form").wait_for(state="visible")
                assert violations(page.page, axe) == []
            service.bench.move("anna", t_ns=time.time_ns())
            page = opened.enter_context(tag_page(chromium, service.link, SERIAL))
            page.page.locator("#live").wait_for(state="visible")
            assert violations(page.page, axe) == []
            page.start()
            page.move()
            page.wait_for("counts.sent > 30")
            assert violations(page.page, axe) == []
        page.wait_for("document.getElementById('state').textContent === 'Out of date'")
        assert violations(page.page, axe) == []
