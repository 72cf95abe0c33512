/** Stored tracks, as the service thins them, and the pose of every tag at a time between their points. */

import { NUMBERS, UNKNOWN, packed } from "./packed_tracks.js";

/** @typedef {import("./packed_tracks.js").Packed} Packed */

/** Points further apart are not joined: what the tag did in between is not known well enough. */
const JOIN_MS = 10_000;

/** The tracks of many tags. */
export class Tracks {
  /** Made when a tag is looked up. @type {Map<string, number> | null} */
  #rows = null;

  /** @param {Packed} all */
  constructor(all) {
    this.all = all;
  }

  get size() {
    return this.all.tags.length;
  }

  /** The time of the first point; null without any. */
  get first_ms() {
    let first = Infinity;
    for (let row = 0; row < this.size; row++) if (this.all.starts[row] < this.all.starts[row + 1]) first = Math.min(first, this.all.time[this.all.starts[row]]);
    return first === Infinity ? null : first;
  }

  *[Symbol.iterator]() {
    for (let row = 0; row < this.size; row++) yield new Track(this.all, row);
  }

  /** @param {string | null} tag */
  get(tag) {
    if (tag !== null) this.#rows ??= new Map(this.all.tags.map((name, row) => [name, row]));
    const row = this.#rows?.get(tag ?? "");
    return row === undefined ? null : new Track(this.all, row);
  }
}

export const NO_TRACKS = new Tracks(packed([]));

/** One tag's points. */
export class Track {
  /** @param {Packed} all @param {number} row of the tag */
  constructor(all, row) {
    const part = /** @template {Float32Array | Float64Array | Uint8Array} T */ (/** @type {T} */ column) =>
      /** @type {T} */ (column.subarray(all.starts[row], all.starts[row + 1]));
    this.tag = all.tags[row];
    this.time = part(all.time);
    this.x = part(all.number.x);
    this.y = part(all.number.y);
    this.z = part(all.number.z);
    this.z_std_m = part(all.number.z_std_m);
    this.speed_mps = part(all.number.speed_mps);
    /** What is known since the previous point: TRACKING, DOUBTFUL or UNKNOWN. */
    this.since = part(all.since);
    /** How far stored poses since the previous point are from the line, at most, m; NaN: unknown. */
    this.off_m = part(all.number.off_m);
    /** Figures over the whole time; NaN: unknown. */
    this.figure = {
      poses: all.figure.poses[row], tracked_s: all.figure.tracked_s[row], distance_m: all.figure.distance_m[row],
      mean_speed_mps: all.figure.mean_speed_mps[row], max_speed_mps: all.figure.max_speed_mps[row],
    };
  }

  /** Return the index of the last point at or before a time; −1: none. @param {number} time_ms */
  before(time_ms) {
    return before(this.time, 0, this.time.length, time_ms);
  }
}

/** Return the index of the last of these times at or before one; `start` − 1: none. @param {Float64Array} times in order
 * @param {number} start @param {number} end @param {number} time_ms */
function before(times, start, end, time_ms) {
  let [low, high] = [start, end];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time_ms) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/**
 * Return what the stream would have sent at a time in the past: the pose of every tag that had one by then. It is between
 * two points if the tag was known all the way, else the last point with its age. What is not stored is left out.
 * @param {Tracks} tracks @param {number} time_ms
 * @returns {import("./fleet.js").Frame}
 */
export function frameAt({ all }, time_ms) {
  /** @type {string[]} */
  const tags = [];
  const [points, shares] = [new Int32Array(all.tags.length), new Float64Array(all.tags.length)];
  for (let row = 0; row < all.tags.length; row++) {
    const [start, end] = [all.starts[row], all.starts[row + 1]];
    const last = before(all.time, start, end, time_ms);
    if (last < start) continue;
    points[tags.length] = last;
    shares[tags.length] = shareAfter(all, last, end, time_ms);
    tags.push(all.tags[row]);
  }
  return { t_ns: time_ms * 1e6, tags, ...columnsAt(all, points.subarray(0, tags.length), shares, time_ms) };
}

/** @param {Packed} all @param {Int32Array} points the last point of each tag @param {Float64Array} shares how far it is to the next, 0 to 1
 * @param {number} time_ms */
function columnsAt(all, points, shares, time_ms) {
  const { x, y, z, z_std_m, heading_rad, speed_mps, sigma_pos_m, semi_major_m, semi_minor_m, angle_rad } = all.number;
  const to = /** @type {Record<string, Float32Array>} */ (Object.fromEntries(NUMBERS.map((name) => [name, new Float32Array(points.length)])));
  const [state, frame, z_source, floor] = Array.from({ length: 4 }, () => new Array(points.length));
  const age_s = new Float64Array(points.length);
  for (let at = 0; at < points.length; at++) {
    const [i, share] = [points[at], shares[at]];
    const wider = share > 0 && semi_major_m[i + 1] > semi_major_m[i] ? i + 1 : i;
    to.x[at] = mixed(x, i, share);
    to.y[at] = mixed(y, i, share);
    to.z[at] = mixed(z, i, share);
    to.z_std_m[at] = mixedStd(z, z_std_m, i, share);
    z_source[at] = all.sources[all.source[i]] || null;
    const likely = share > 0.5 ? i + 1 : i;
    floor[at] = all.floors[all.floor[likely]] || null;
    to.floor_probability[at] = all.number.floor_probability[likely] * (all.floor[i] === all.floor[i + 1] ? 1 : Math.max(share, 1 - share));
    to.heading_rad[at] = turned(heading_rad[i], heading_rad[i + 1], share);
    to.speed_mps[at] = mixed(speed_mps, i, share);
    to.sigma_pos_m[at] = sigma_pos_m[wider];
    to.semi_major_m[at] = semi_major_m[wider];
    to.semi_minor_m[at] = semi_minor_m[wider];
    to.angle_rad[at] = angle_rad[wider];
    state[at] = all.states[all.state[i]];
    frame[at] = all.turned[i] ? "relative" : "site";
    age_s[at] = share > 0 ? 0 : (time_ms - all.time[i]) / 1000;
  }
  return { ...to, z_source, floor, state, frame, age_s, relative_pose: state.map(() => null) };
}

/** Return how far a time lies between a point and the next, 0 to 1; 0 if the tag was not known all the way.
 * @param {Packed} all @param {number} i @param {number} end of the tag's points @param {number} time_ms */
function shareAfter(all, i, end, time_ms) {
  if (i + 1 >= end || all.since[i + 1] === UNKNOWN) return 0;
  const length = all.time[i + 1] - all.time[i];
  return length <= JOIN_MS ? (time_ms - all.time[i]) / length : 0;
}

/** @param {Float32Array} values @param {number} i @param {number} share */
function mixed(values, i, share) {
  const [from, to] = [values[i], values[i + 1]];
  return share > 0 && !Number.isNaN(to) ? from + share * (to - from) : from;
}

/** Return the standard deviation of a value that changes from one to the next at any time between them.
 * @param {Float32Array} values @param {Float32Array} stds @param {number} i @param {number} share */
function mixedStd(values, stds, i, share) {
  if (!(share > 0) || Number.isNaN(values[i + 1])) return stds[i];
  const variance = (1 - share) * stds[i] ** 2 + share * stds[i + 1] ** 2;
  return Math.sqrt(variance + share * (1 - share) * (values[i + 1] - values[i]) ** 2);
}

/** Return a direction between two, the short way round. @param {number} from @param {number} to @param {number} share */
function turned(from, to, share) {
  if (share === 0 || Number.isNaN(to)) return from;
  const turn = Math.atan2(Math.sin(to - from), Math.cos(to - from));
  return from + share * turn;
}
