"""UWB modules at the page of a tag, by Web Serial and Web Bluetooth, in a real browser against the real interface."""

import struct
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from dropanchor_schemas.wire import anchor_number
from support.module_strings import LEC, LEC_DAMAGED, LEC_RANGES, LES, LES_RANGES
from support.tag_page import BLUETOOTH, NO_MODULES, SERIAL, tag_page
from support.tag_page_service import Service
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


@pytest.fixture
def service(tmp_path: Path) -> Service:
    return Service(tmp_path)


def test_a_module_at_a_serial_port_gives_the_ranges(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link, SERIAL) as page:
        page.start()
        page.page.locator("#usb").click()
        page.wait_for("written.length === 2")
        assert page.page.evaluate("[baudRate, ...written]") == [115200, "\r\r", "lec\r"]
        text = f"dwm> lec\r\n{LEC}\r\n{LEC_DAMAGED}\r\n{LES}\r\n"
        for part in (text[:30], text[30:200], text[200:]):
            page.page.evaluate("text => module.print(text)", part)
        wait_until(lambda: sum(len(frame.ranges) for frame in service.frames()) == 8)
        page.wait_for("document.getElementById('ranges').textContent === '8 ranges, 1 damaged'")
        page.page.evaluate("module.unplug()")
        page.wait_for("document.getElementById('module-problem').textContent")
        assert page.text("module-problem") == "The module cannot be read: The device has been lost."
        assert page.page.locator("#usb").is_visible()
    expected = [(anchor_number(name), range_m) for name, range_m in [*LEC_RANGES, *LES_RANGES]]
    assert received_ranges(service) == expected


def location_data(distances: dict[int, int], position: bytes | None = None) -> str:
    """Return the value of a DWM1001's characteristic "location data" in hexadecimal. distances: mm by anchor."""
    head = b"\x01" if position is None else b"\x02" + position
    items = b"".join(struct.pack("<HiB", anchor, mm, 100) for anchor, mm in distances.items())
    return (head + bytes([len(distances)]) + items).hex()


def received_ranges(service: Service) -> list[tuple[int, float]]:
    return [(sample.anchor, round(sample.range_m, 3)) for frame in service.frames() for sample in frame.ranges]


def test_a_module_near_the_phone_gives_the_ranges_by_bluetooth_also_after_an_interruption(
    chromium: Browser, service: Service
) -> None:
    position = struct.pack("<iiiB", 6950, 5370, -1970, 52)
    with service.running(), tag_page(chromium, service.link, BLUETOOTH) as page:
        page.start()
        page.page.locator("#bluetooth").click()
        page.wait_for("document.getElementById('ranges').textContent === '0 ranges'")
        assert page.page.evaluate("module.state.mode") == 1, "the module is to report distances"
        for value in ("", location_data({0x022E: 3440, 0x9280: 5680}), location_data({0x022E: 3380}, position)):
            page.page.evaluate("value => module.notify(value)", value)
        page.page.evaluate("value => module.notify(value)", location_data({0x022E: 3440, 0x9280: 5680})[:-2])
        page.wait_for("document.getElementById('ranges').textContent === '3 ranges, 1 damaged'")
        page.page.evaluate("module.leave()")
        page.wait_for("document.getElementById('module-problem').textContent.includes('cannot be read')")
        page.page.evaluate("module.state.near = true")
        page.wait_for("module.state.connections === 2 && document.getElementById('bluetooth').hidden")
        page.page.evaluate("value => module.notify(value)", location_data({0x022E: 3300}))
        wait_until(lambda: len(received_ranges(service)) == 4)
        assert page.text("module-problem") == ""
        assert page.errors == []
    yard = anchor_number("022E")
    assert received_ranges(service) == [(yard, 3.44), (9280, 5.68), (yard, 3.38), (yard, 3.3)]


def test_a_module_that_reports_no_ranges_and_a_person_who_chooses_none_give_a_sentence(
    chromium: Browser, service: Service
) -> None:
    with service.running(), tag_page(chromium, service.link, BLUETOOTH) as page:
        page.page.evaluate("module.state.refused = true")
        page.page.locator("#bluetooth").click()
        page.wait_for("document.getElementById('module-problem').textContent.startsWith('No module was chosen: User')")
        page.page.evaluate("module.state.refused = false")
        page.page.locator("#bluetooth").click()
        page.wait_for(
            "document.getElementById('module-problem').textContent.startsWith('The module reports no ranges')"
        )


def test_a_browser_that_reaches_no_module_says_so(chromium: Browser, service: Service) -> None:
    with service.running(), tag_page(chromium, service.link, NO_MODULES) as page:
        page.page.locator("#live").wait_for(state="visible")
        assert page.text("module-hint").startswith("This browser reaches no UWB module")
        assert not page.page.locator("#modules").is_visible()
