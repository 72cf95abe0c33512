/** A UWB module on a serial port of this device, by Web Serial (Chrome and Edge, over HTTPS). */

import { Dwm1001 } from "./dwm1001.js";
import { anchorNumber } from "./packed.js";
import { t } from "../i18n/language.js";

const BAUD = 115_200;
/** Written, one by one, while the module says nothing: `lec` would stop a module that prints already. */
const WAKE = ["\r\r", "lec\r"];
const SILENT_MS = 1500;

/**
 * @typedef {object} Port of Web Serial, whose types no standard library has
 * @property {(options: { baudRate: number }) => Promise<void>} open
 * @property {() => Promise<void>} close
 * @property {ReadableStream<Uint8Array>} readable
 * @property {WritableStream<Uint8Array>} writable
 */

export const hasSerial = () => "serial" in navigator;

export class Serial {
  /** A sentence for the person. */
  problem = "";
  connected = false;
  ranges = 0;
  #parser = new Dwm1001();
  #timer = 0;

  /** @param {import("./clock.js").Clock} clock @param {(sample: import("./packed.js").RangeSample) => void} take */
  constructor(clock, take) {
    this.clock = clock;
    this.take = take;
  }

  /** Lines that look like ranges but are damaged. */
  get damaged() {
    return this.#parser.damaged;
  }

  /** Let the person choose a port, and read it until it is unplugged. Call it in a tap. */
  async connect() {
    const serial = /** @type {{ serial: { requestPort: () => Promise<Port> } }} */ (/** @type {unknown} */ (navigator)).serial;
    this.problem = "";
    try {
      const port = await serial.requestPort();
      await port.open({ baudRate: BAUD });
      this.connected = true;
      await this.#read(port);
      this.problem = t("phone.unplugged");
    } catch (error) {
      const { name, message } = /** @type {Error} */ (error);
      this.problem = name === "NotFoundError" ? t("phone.no_port") : t("phone.unreadable", { message });
    }
    this.connected = false;
    clearTimeout(this.#timer);
  }

  /** @param {Port} port */
  async #read(port) {
    const decoder = new TextDecoder("latin1");
    this.#wakeLater(port, [...WAKE]);
    try {
      for (const reader = port.readable.getReader(); ; ) {
        const { value, done } = await reader.read();
        if (done) return;
        this.#received(decoder.decode(value, { stream: true }));
      }
    } finally {
      await port.close().catch(() => undefined); // it is gone already when it was unplugged
    }
  }

  /** @param {string} text */
  #received(text) {
    const t_us = this.clock.local_us();
    for (const { anchor, range_m } of this.#parser.feed(text)) {
      clearTimeout(this.#timer);
      this.problem = "";
      this.ranges++;
      this.take({ t_us, anchor: anchorNumber(anchor), range_m });
    }
  }

  /** @param {Port} port @param {string[]} words */
  #wakeLater(port, words) {
    this.#timer = setTimeout(async () => {
      const word = words.shift();
      if (word === undefined) {
        this.problem = t("phone.prints_nothing");
        return;
      }
      const writer = port.writable.getWriter();
      await writer.write(new TextEncoder().encode(word)).catch(() => undefined); // the reader notices that it is gone
      writer.releaseLock();
      this.#wakeLater(port, words);
    }, SILENT_MS);
  }
}
