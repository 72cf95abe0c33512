/** The trails of the last seconds before a time in the past. They look like live trails to the map. */

import { TRAIL_S } from "./trails.js";

/** @typedef {import("./tracks.js").Track} Track */

export class PastTrails {
  /** @type {Map<string, Track>} */
  #tracks = new Map();
  #time_ms = 0;

  /** @param {readonly Track[]} tracks @param {number} time_ms in the past */
  show(tracks, time_ms) {
    this.#tracks = new Map(tracks.map((track) => [track.tag, track]));
    this.#time_ms = time_ms;
  }

  /** Return the trail with times on the clock of the page. @param {string} name */
  of(name) {
    const track = this.#tracks.get(name);
    return track ? trailOf(track, this.#time_ms, performance.now()) : null;
  }
}

/** Return the points of the last seconds, with a NaN in x where the trail breaks.
 * @param {Track} track @param {number} time_ms in the past @param {number} now_ms that time on the clock of the page */
export function trailOf(track, time_ms, now_ms) {
  const [x, y, time, trusted] = /** @type {[number[], number[], number[], number[]]} */ ([[], [], [], []]);
  const add = (/** @type {number} */ i, /** @type {number} */ px) => {
    x.push(px);
    y.push(track.y[i]);
    time.push(now_ms - (time_ms - track.time[i]));
    trusted.push(track.points.since_previous[i] === "tracking" ? 1 : 0);
  };
  const last = track.before(time_ms);
  for (let i = track.before(time_ms - TRAIL_S * 1000) + 1; i <= last; i++) {
    if (track.points.since_previous[i] === "unknown") add(i, NaN);
    add(i, track.x[i]);
  }
  return { x, y, time, trusted, length: x.length, at: (/** @type {number} */ i) => i };
}
