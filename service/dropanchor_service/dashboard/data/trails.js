/** The positions of each tag in the last seconds: a ring buffer per tag, without poses whose position is unknown. */

import { TRACKING, UNKNOWN } from "./packed_tracks.js";
import { STATES } from "./states.js";

export const TRAIL_S = 30;
const INTERVAL_MS = 200;
const CAPACITY = (TRAIL_S * 1000) / INTERVAL_MS + 1;

class Trail {
  x = new Float32Array(CAPACITY);
  y = new Float32Array(CAPACITY);
  time = new Float64Array(CAPACITY);
  /** 1: trusted; 0: doubtful position. A NaN in x marks a gap. */
  trusted = new Uint8Array(CAPACITY);
  length = 0;
  #next = 0;

  /** @param {number} x @param {number} y @param {boolean} trusted @param {number} time_ms */
  add(x, y, trusted, time_ms) {
    const at = this.#next;
    this.x[at] = x;
    this.y[at] = y;
    this.time[at] = time_ms;
    this.trusted[at] = trusted ? 1 : 0;
    this.#next = (at + 1) % CAPACITY;
    this.length = Math.min(CAPACITY, this.length + 1);
  }

  /** @param {number} time_ms */
  dropSince(time_ms) {
    while (this.lastTime >= time_ms) {
      this.#next = this.at(this.length - 1);
      this.length--;
    }
  }

  /** Return the index of the i-th oldest point in the arrays. @param {number} i */
  at(i) {
    return (this.#next - this.length + i + CAPACITY) % CAPACITY;
  }

  get lastTime() {
    return this.length ? this.time[this.at(this.length - 1)] : -Infinity;
  }

  get ended() {
    return this.length > 0 && Number.isNaN(this.x[this.at(this.length - 1)]);
  }
}

export class Trails {
  /** @type {Map<string, Trail>} */
  #trails = new Map();

  /** @param {string} name */
  of(name) {
    return this.#trails.get(name) ?? null;
  }

  /**
   * Add the current positions of the named tags.
   * @param {import("./fleet.js").Fleet} fleet
   * @param {string[]} names
   * @param {number} now_ms
   */
  note(fleet, names, now_ms) {
    for (const name of names) {
      const row = fleet.row(name);
      const state = STATES[fleet.state[row]];
      const x = fleet.number.x[row];
      if (state.placed && Number.isFinite(x)) this.#extend(name, x, fleet.number.y[row], state.trusted, now_ms);
      else this.#interrupt(name, now_ms);
    }
  }

  /**
   * Put stored points before those that were noted.
   * @param {import("./tracks.js").Track} track @param {number} zero_ms time 0 of the track on the clock of the page
   */
  prepend(track, zero_ms) {
    const noted = this.#trails.get(track.tag);
    const end_ms = noted?.length ? noted.time[noted.at(0)] : Infinity;
    const trail = new Trail();
    for (let i = 0; i < track.time.length && zero_ms + track.time[i] < end_ms; i++) {
      const time_ms = zero_ms + track.time[i];
      if (trail.length > 0 && track.since[i] === UNKNOWN) trail.add(NaN, NaN, false, time_ms);
      trail.add(track.x[i], track.y[i], track.since[i] === TRACKING, time_ms);
    }
    for (let i = 0; i < (noted?.length ?? 0); i++) {
      const at = /** @type {Trail} */ (noted).at(i);
      const { x, y, trusted, time } = /** @type {Trail} */ (noted);
      trail.add(x[at], y[at], trusted[at] === 1, time[at]);
    }
    this.#trails.set(track.tag, trail);
  }

  /** Forget where a tag was since a time. @param {string} name @param {number} since_ms */
  forget(name, since_ms) {
    this.#trails.get(name)?.dropSince(since_ms);
  }

  /** Delete the trails of tags that no longer exist. @param {import("./fleet.js").Fleet} fleet */
  prune(fleet) {
    for (const name of this.#trails.keys()) if (fleet.row(name) < 0) this.#trails.delete(name);
  }

  /** @param {string} name @param {number} x @param {number} y @param {boolean} trusted @param {number} now_ms */
  #extend(name, x, y, trusted, now_ms) {
    let trail = this.#trails.get(name);
    if (!trail) this.#trails.set(name, (trail = new Trail()));
    if (now_ms - trail.lastTime >= INTERVAL_MS * 0.9) trail.add(x, y, trusted, now_ms);
  }

  /** @param {string} name @param {number} now_ms */
  #interrupt(name, now_ms) {
    const trail = this.#trails.get(name);
    if (trail && !trail.ended) trail.add(NaN, NaN, false, now_ms);
  }
}
