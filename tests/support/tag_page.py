"""The page of a tag in a real browser, with sensors, a serial port and a Bluetooth module that the test plays."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from playwright.sync_api import Browser, Page

from support.browser import wait_for_truth
from support.patience import PATIENCE_S

PHONE = (390, 844)
SENSORS = """
    const step_ms = 1000 / 60;
    let timer = 0;
    window.phone = {
        report(acceleration, rotation, shake, times) {
            for (let i = 0; i < times; i++) {
                const [x, y, z] = acceleration.map((value) => value + shake * (2 * Math.random() - 1));
                const [alpha, beta, gamma] = rotation.map((value) => value + shake * 0.02 * (2 * Math.random() - 1));
                dispatchEvent(new DeviceMotionEvent("devicemotion", {
                    accelerationIncludingGravity: { x, y, z }, rotationRate: { alpha, beta, gamma }, interval: step_ms,
                }));
            }
        },
        start(...values) {
            clearInterval(timer);
            timer = setInterval(() => phone.report(...values, 1), step_ms);
        },
        stop() { clearInterval(timer); },
    };
"""
APPLE = """
    Object.defineProperty(Navigator.prototype, "vendor", { get: () => "Apple Computer, Inc." });
    window.asked = 0;
    DeviceMotionEvent.requestPermission = async () => {
        window.asked += 1;
        return navigator.userActivation.isActive ? "%s" : "denied";
    };
"""
SERIAL = """
    const written = window.written = [];
    let printer;
    const port = {
        async open({ baudRate }) { window.baudRate = baudRate; },
        async close() {},
        readable: new ReadableStream({ start(controller) { printer = controller; } }),
        writable: new WritableStream({ write(bytes) { written.push(new TextDecoder().decode(bytes)); } }),
    };
    window.module = {
        print(text) { printer.enqueue(new TextEncoder().encode(text)); },
        unplug() { printer.error(new DOMException("The device has been lost.", "NetworkError")); },
    };
    Object.defineProperty(navigator, "serial", { value: { requestPort: async () => port } });
"""
BLUETOOTH = """
    const SERVICE = "680c21d9-c946-4c1f-9c11-baa1c21329e7";
    const [DATA, MODE] = ["003bbdf2-c634-4b3d-ab56-7ec889b89a37", "a02b947e-df97-4516-996a-1882521e0ead"];
    const viewOf = (hex) => new DataView(Uint8Array.from(hex.match(/../g) ?? [], (byte) => parseInt(byte, 16)).buffer);
    const state = { mode: 0, near: true, connections: 0 };
    let data = null;

    class Characteristic extends EventTarget {
        async readValue() { return new DataView(Uint8Array.of(state.mode).buffer); }
        async writeValueWithResponse(bytes) { [state.mode] = bytes; }
        async startNotifications() { data = this; }
    }
    const characteristics = { [DATA]: () => new Characteristic(), [MODE]: () => new Characteristic() };
    const found = (things, uuid) => {
        if (!(uuid in things)) throw new DOMException(`No match for ${uuid}.`, "NotFoundError");
        return things[uuid]();
    };
    const service = { getCharacteristic: async (uuid) => found(characteristics, uuid) };
    const server = { getPrimaryService: async (uuid) => found({ [SERVICE]: () => service }, uuid) };
    const device = Object.assign(new EventTarget(), { gatt: { async connect() {
        if (!state.near) throw new DOMException("Connection attempt failed.", "NetworkError");
        state.connections++;
        return server;
    } } });
    window.module = {
        state,
        notify(hex) {
            data.value = viewOf(hex);
            data.dispatchEvent(new Event("characteristicvaluechanged"));
        },
        leave() {
            state.near = false;
            data = null;
            device.dispatchEvent(new Event("gattserverdisconnected"));
        },
    };
    Object.defineProperty(navigator, "bluetooth", { value: { async requestDevice(options) {
        state.asked = options;
        if (state.refused) throw new DOMException("User cancelled the requestDevice() chooser.", "NotFoundError");
        return device;
    } } });
"""
NO_MODULES = "delete Navigator.prototype.serial; delete Navigator.prototype.bluetooth;"


@dataclass
class TagPage:
    """errors: what the page logged, except for connections that failed."""

    page: Page
    errors: list[str] = field(default_factory=list)

    def start(self) -> None:
        self.page.locator("#toggle").click()

    def move(
        self,
        acceleration: tuple[float, ...] = (0.0, 0.0, 9.81),
        rotation: tuple[float, ...] = (0, 0, 0),
        shake: float = 0.0,
    ) -> None:
        """Play a sensor that goes on reporting this, in the phone's axes, m/s² and °/s. shake: at random, m/s²."""
        self.page.evaluate("values => phone.start(...values)", [acceleration, rotation, shake])

    def rest(self) -> None:
        """Let the sensors report nothing more."""
        self.page.evaluate("phone.stop()")

    def counts(self) -> dict[str, int]:
        counts: dict[str, int] = self.page.evaluate("dropanchor.counts()")
        return counts

    def wait_for(self, condition: str, timeout_s: float = PATIENCE_S) -> None:
        """Wait until a JavaScript expression is true; `counts` in it are the numbers of samples."""
        script = f"() => {{ const counts = window.dropanchor?.counts() ?? {{}}; return ({condition}); }}"
        wait_for_truth(self.page, script, timeout_s, lambda: self.text("live"))

    def text(self, element: str) -> str:
        return self.page.locator(f"#{element}").inner_text()


@contextmanager
def tag_page(browser: Browser, url: str, *scripts: str, **options: Any) -> Iterator[TagPage]:
    """Open the page on a phone's screen. scripts: run in it before its own."""
    context = browser.new_context(viewport={"width": PHONE[0], "height": PHONE[1]}, reduced_motion="reduce", **options)
    for script in (SENSORS, *scripts):
        context.add_init_script(f"{{ {script} }}")
    context.set_default_timeout(1000 * PATIENCE_S)
    opened = TagPage(context.new_page())
    opened.page.on("pageerror", lambda error: opened.errors.append(str(error)))
    opened.page.on("console", lambda line: _note(opened.errors, line.type, line.text))
    opened.page.goto(url)
    try:
        yield opened
    finally:
        context.close()


def _note(errors: list[str], kind: str, text: str) -> None:
    if kind in ("error", "warning") and "WebSocket connection to" not in text:
        errors.append(text)
