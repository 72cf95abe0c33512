/** Where a tag stood in a period of the past, and for how long. */

import { UNKNOWN } from "./packed_tracks.js";

/** A tag that stays within so much of where it stopped stands. */
const WITHIN_M = 1.5;
/** A shorter stop is none. */
const SHORTEST_MS = 60_000;

/** Return the times at which a tag stood, in order. What stored poses between two points did counts, too.
 * @param {Pick<import("./tracks.js").Track, "time" | "x" | "y" | "since" | "off_m">} track @returns {import("./periods.js").Period[]} */
export function stopsOf({ time, x, y, since, off_m }) {
  /** @type {import("./periods.js").Period[]} */
  const stops = [];
  for (let begin = 0, end; begin < time.length; begin = Math.max(end, begin + 1)) {
    for (end = begin; end + 1 < time.length && isThere(end + 1, begin); end++);
    if (time[end] - time[begin] >= SHORTEST_MS) stops.push({ from_ms: time[begin], to_ms: time[end] });
  }
  return stops;

  /** @param {number} i @param {number} begin */
  function isThere(i, begin) {
    return since[i] !== UNKNOWN && Math.hypot(x[i] - x[begin], y[i] - y[begin]) + (off_m[i] || 0) <= WITHIN_M;
  }
}
