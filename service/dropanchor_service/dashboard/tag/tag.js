/** The tag that this device is: its samples become numbered messages in the queue. */

import { Bluetooth } from "./bluetooth.js";
import { Clock } from "./clock.js";
import { ingest, storeOf } from "./link.js";
import { Motion } from "./motion.js";
import { packed } from "./packed.js";
import { Queue, Store } from "./queue.js";
import { Serial } from "./serial.js";
import { Uplink } from "./uplink.js";

const MESSAGE_MS = 100;
const SAVE_MS = 1000;
/** Samples of one kind in a message. A payload has room for more, and browsers slow down the timers of hidden pages. */
const MAX_OF_A_KIND = 1000;

export class ThisTag {
  running = false;
  /** Samples since the page was opened. */
  taken = 0;
  #imu = /** @type {import("./packed.js").ImuSample[]} */ ([]);
  #ranges = /** @type {import("./packed.js").RangeSample[]} */ ([]);
  #sequence = 0;
  #bootId = 0;
  #wakeLock = /** @type {WakeLockSentinel | null} */ (null);

  /** @param {string} name @param {string} key empty for a service without keys @param {Store} store */
  constructor(name, key, store) {
    const url = ingest(`stream?${new URLSearchParams({ tag: name, reasons: "code" })}`);
    url.protocol = url.protocol.replace("http", "ws");
    this.name = name;
    this.clock = new Clock();
    this.queue = new Queue(store);
    this.uplink = new Uplink(url, key, this.queue, this.clock);
    this.motion = new Motion(this.clock, (sample) => this.#take(this.#imu, sample));
    const takeRange = (/** @type {import("./packed.js").RangeSample} */ sample) => this.#take(this.#ranges, sample);
    this.serial = new Serial(this.clock, takeRange);
    this.bluetooth = new Bluetooth(this.clock, takeRange);
    setInterval(() => this.#turn(), MESSAGE_MS);
    setInterval(() => this.#save(), SAVE_MS);
    addEventListener("pagehide", () => this.#save());
    document.addEventListener("visibilitychange", () => this.#seen());
  }

  /** @param {string} name @param {string} key */
  static async open(name, key) {
    const tag = new ThisTag(name, key, await Store.open(storeOf(name)));
    await tag.queue.load();
    return tag;
  }

  /** Take samples and send them. Call it in a tap. */
  async start() {
    this.clock.set();
    this.#sequence = 0;
    this.#bootId = crypto.getRandomValues(new Uint32Array(1))[0] || 1; // 0 stands for messages without numbers
    this.running = true;
    this.uplink.open();
    await this.motion.start();
    await this.#stayAwake();
  }

  /** Take no more samples. What waits is still sent. */
  async stop() {
    this.motion.stop();
    this.#turn();
    this.running = false;
    await this.#wakeLock?.release();
  }

  /** Whether the screen is kept on: browsers stop the sensors when it goes off. */
  get awake() {
    return this.#wakeLock !== null && !this.#wakeLock.released;
  }

  /** @template S @param {S[]} samples @param {S} sample */
  #take(samples, sample) {
    if (!this.running) return;
    samples.push(sample);
    this.taken++;
  }

  #turn() {
    while (this.#imu.length || this.#ranges.length) {
      const [imu, ranges] = [this.#imu.splice(0, MAX_OF_A_KIND), this.#ranges.splice(0, MAX_OF_A_KIND)];
      this.queue.add({ samples: imu.length + ranges.length, ...packed(imu, ranges, this.#sequence++, this.#bootId) });
    }
    this.uplink.send();
    if (!this.running && !this.queue.length && this.uplink.status === "open") this.uplink.close();
  }

  #save() {
    this.queue.save().catch((error) => console.warn("the queue cannot be stored", error));
  }

  #seen() {
    if (document.visibilityState !== "visible") {
      this.#save();
    } else if (this.running) {
      this.clock.set();
      this.#stayAwake();
    }
  }

  async #stayAwake() {
    try {
      this.#wakeLock = (await navigator.wakeLock?.request("screen")) ?? null;
    } catch {
      this.#wakeLock = null; // the screen says that it may go off
    }
  }
}
