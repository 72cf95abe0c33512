/** The trails of the last seconds before a time in the past. They look like live trails to the map. */

import { TRACKING, UNKNOWN } from "./packed_tracks.js";
import { NO_TRACKS } from "./tracks.js";
import { TRAIL_S } from "./trails.js";

/** @typedef {import("./tracks.js").Track} Track */

export class PastTrails {
  #tracks = NO_TRACKS;
  #time_ms = 0;

  /** @param {import("./tracks.js").Tracks} tracks @param {number} time_ms in the past */
  show(tracks, time_ms) {
    this.#tracks = tracks;
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
    trusted.push(track.since[i] === TRACKING ? 1 : 0);
  };
  const last = track.before(time_ms);
  for (let i = track.before(time_ms - TRAIL_S * 1000) + 1; i <= last; i++) {
    if (track.since[i] === UNKNOWN) add(i, NaN);
    add(i, track.x[i]);
  }
  return { x, y, time, trusted, length: x.length, at: (/** @type {number} */ i) => i };
}
