/**
 * Motion of the phone as IMU samples.
 *
 * Phone: x right, y to the top edge, z out of the screen, whichever way the page is turned. Tag: x forward, y left, z up.
 * The top edge is forward.
 *
 * `rotationRate` is in °/s; alpha, beta and gamma turn about x, y and z, as the example of the specification, Chromium
 * and Firefox have it (https://www.w3.org/TR/orientation-event/). `accelerationIncludingGravity` is specific force, z +9.81
 * at rest with the screen up. Apple's browsers report its negative.
 */

import { t } from "../i18n/language.js";

const RAD_PER_DEG = Math.PI / 180;
const NONE_MS = 3000;
const RATE_MS = 2000;
const MAX_EVENT_AGE_MS = 1000;
const FLAT_MPS2 = 7;

/** @param {number} x @param {number} y @param {number} z */
const onTag = (x, y, z) => [y, -x, z];

/** Return the factor that makes accelerations specific forces. @param {string} vendor of the browser */
export const signOf = (vendor) => (vendor.startsWith("Apple") ? -1 : 1);

/**
 * Return the sample of an event; null when the phone lacks a sensor.
 * @param {Pick<DeviceMotionEvent, "accelerationIncludingGravity" | "rotationRate">} event
 * @param {number} sign @param {number} t_us @returns {import("./packed.js").ImuSample | null}
 */
export function sampleOf({ accelerationIncludingGravity: a, rotationRate: r }, sign, t_us) {
  const force = [a?.x, a?.y, a?.z];
  const turn = [r?.alpha, r?.beta, r?.gamma];
  if (![...force, ...turn].every(Number.isFinite)) return null;
  const [fx, fy, fz] = force.map((value) => sign * Number(value));
  const [wx, wy, wz] = turn.map((value) => RAD_PER_DEG * Number(value));
  return { t_us, acc: onTag(fx, fy, fz), gyro: onTag(wx, wy, wz) };
}

/** Listens to the sensors while it is on. */
export class Motion {
  /** A sentence for the person; empty when samples come. */
  problem = "";
  /** Which way the screen points, for a look at the signs: "up", "down" or "" while the phone is tilted. */
  screen = "";
  #times = /** @type {number[]} */ ([]);
  #last_us = 0;
  #watch = 0;

  /**
   * @param {import("./clock.js").Clock} clock @param {(sample: import("./packed.js").ImuSample) => void} take
   * @param {string} vendor of the browser
   */
  constructor(clock, take, vendor = navigator.vendor) {
    this.clock = clock;
    this.take = take;
    this.sign = signOf(vendor);
    this.listener = (/** @type {DeviceMotionEvent} */ event) => this.#on(event);
  }

  /** Start listening. Call it in a tap: Apple's browsers ask the person, and only then. */
  async start() {
    this.problem = await refusal();
    if (this.problem) return;
    addEventListener("devicemotion", this.listener);
    this.#watch = setTimeout(() => this.#complain(), NONE_MS);
  }

  stop() {
    removeEventListener("devicemotion", this.listener);
    clearTimeout(this.#watch);
    this.#times = [];
    this.problem = this.screen = "";
  }

  /** Samples per second. */
  get rate_hz() {
    const since = performance.now() - RATE_MS;
    this.#times = this.#times.filter((time) => time > since);
    return (1000 * this.#times.length) / RATE_MS;
  }

  /** @param {DeviceMotionEvent} event */
  #on(event) {
    const now_ms = performance.now();
    const time_ms = Math.abs(now_ms - event.timeStamp) < MAX_EVENT_AGE_MS ? event.timeStamp : now_ms;
    const sample = sampleOf(event, this.sign, Math.max(this.clock.local_us(time_ms), this.#last_us + 1));
    if (sample === null) return;
    clearTimeout(this.#watch);
    this.problem = "";
    this.#last_us = sample.t_us;
    this.#times.push(now_ms);
    const up = sample.acc[2];
    this.screen = up > FLAT_MPS2 ? "up" : up < -FLAT_MPS2 ? "down" : "";
    this.take(sample);
  }

  #complain() {
    this.problem = t("phone.no_motion");
  }
}

/** Ask for the permission where there is one to ask for. Return a sentence when there are no sensors to listen to. */
async function refusal() {
  if (!isSecureContext) return t("phone.https_motion");
  if (!("DeviceMotionEvent" in window)) return t("phone.no_sensors");
  const asking = /** @type {{ requestPermission?: () => Promise<string> }} */ (/** @type {unknown} */ (DeviceMotionEvent));
  try {
    if ((await asking.requestPermission?.()) === "denied") return t("phone.motion_denied");
  } catch {
    return t("phone.motion_not_asked");
  }
  return "";
}
