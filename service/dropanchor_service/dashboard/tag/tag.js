/** The tag that this device is: its samples become numbered messages in the queue. */

import { Clock } from "./clock.js";
import { Motion } from "./motion.js";
import { packed } from "./packed.js";
import { Queue, Store } from "./queue.js";
import { Serial } from "./serial.js";
import { Uplink } from "./uplink.js";

const MESSAGE_MS = 100;
const SAVE_MS = 1000;

export class ThisTag {
  running = false;
  /** Samples of this start. */
  taken = 0;
  #imu = /** @type {import("./packed.js").ImuSample[]} */ ([]);
  #ranges = /** @type {import("./packed.js").RangeSample[]} */ ([]);
  #sequence = 0;
  #bootId = 0;
  #wakeLock = /** @type {WakeLockSentinel | null} */ (null);

  /** @param {string} name @param {string} key empty for a service without keys @param {Store} store */
  constructor(name, key, store) {
    const url = new URL(`../api/v1/ingest/stream?tag=${encodeURIComponent(name)}`, document.baseURI);
    url.protocol = url.protocol.replace("http", "ws");
    this.name = name;
    this.clock = new Clock();
    this.queue = new Queue(store);
    this.uplink = new Uplink(url, key, this.queue, this.clock);
    this.motion = new Motion(this.clock, (sample) => this.running && this.#imu.push(sample));
    this.serial = new Serial(this.clock, (sample) => this.running && this.#ranges.push(sample));
    setInterval(() => this.#turn(), MESSAGE_MS);
    setInterval(() => this.#save(), SAVE_MS);
    addEventListener("pagehide", () => this.#save());
    document.addEventListener("visibilitychange", () => this.#seen());
  }

  /** @param {string} name @param {string} key */
  static async open(name, key) {
    const tag = new ThisTag(name, key, await Store.open(name));
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

  #turn() {
    const [imu, ranges] = [this.#imu.splice(0), this.#ranges.splice(0)];
    const samples = imu.length + ranges.length;
    if (samples) {
      this.taken += samples;
      this.queue.add({ samples, ...packed(imu, ranges, this.#sequence++, this.#bootId) });
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
