/** The tracks of an answer as a few long columns, which cost ten thousand tags no more objects than one. */

/**
 * @typedef {object} Points columns of equal length, as in the contract
 * @property {number[]} t_ns
 * @property {string[]} state
 * @property {string[]} frame
 * @property {(number | null)[]} x
 * @property {(number | null)[]} y
 * @property {(number | null)[]} z
 * @property {(number | null)[]} z_std_m
 * @property {(string | null)[]} z_source
 * @property {(string | null)[]} floor
 * @property {(number | null)[]} floor_probability
 * @property {(number | null)[]} heading_rad
 * @property {(number | null)[]} speed_mps
 * @property {(number | null)[]} sigma_pos_m
 * @property {(number | null)[]} semi_major_m
 * @property {(number | null)[]} semi_minor_m
 * @property {(number | null)[]} angle_rad
 * @property {("tracking" | "doubtful" | "unknown")[]} since_previous
 * @property {(number | null)[]} off_m
 *
 * @typedef {object} TagTrack as in the contract
 * @property {string} tag
 * @property {number} poses
 * @property {number} tracked_s
 * @property {number} distance_m
 * @property {number | null} mean_speed_mps
 * @property {number | null} max_speed_mps
 * @property {Points} points
 *
 * @typedef {object} Packed the points of all tags one after the other; unknown numbers are NaN
 * @property {string[]} tags
 * @property {Int32Array} starts of each tag's points, and the end
 * @property {string[]} states that `state` counts
 * @property {string[]} sources of heights that `source` counts; empty: none
 * @property {string[]} floors that `floor` counts; empty: none
 * @property {Float64Array} time ms
 * @property {Uint8Array} state
 * @property {Uint8Array} source of the height
 * @property {Uint8Array} floor
 * @property {Uint8Array} turned 1: in a frame of the tag's own
 * @property {Uint8Array} since what is known since the previous point: TRACKING, DOUBTFUL or UNKNOWN
 * @property {Record<typeof NUMBERS[number], Float32Array>} number
 * @property {Record<typeof FIGURES[number], Float64Array>} figure of each tag
 */

export const NUMBERS = /** @type {const} */ ([
  "x", "y", "z", "z_std_m", "floor_probability", "heading_rad", "speed_mps", "sigma_pos_m", "semi_major_m", "semi_minor_m", "angle_rad", "off_m",
]);
export const FIGURES = /** @type {const} */ (["poses", "tracked_s", "distance_m", "mean_speed_mps", "max_speed_mps"]);
export const TRACKING = 0;
export const DOUBTFUL = 1;
export const UNKNOWN = 2;
const BETWEEN = ["tracking", "doubtful", "unknown"];

/** Pack tracks. A place in a frame of the tag's own is no place of the map: it is unknown. @param {readonly TagTrack[]} tracks @returns {Packed} */
export function packed(tracks) {
  const starts = Int32Array.from({ length: tracks.length + 1 });
  tracks.forEach(({ points }, i) => (starts[i + 1] = starts[i] + points.t_ns.length));
  const length = starts[tracks.length];
  const all = {
    tags: tracks.map(({ tag }) => tag), starts, states: /** @type {string[]} */ ([]), sources: /** @type {string[]} */ ([]), floors: /** @type {string[]} */ ([]), time: new Float64Array(length),
    state: new Uint8Array(length), source: new Uint8Array(length), floor: new Uint8Array(length), turned: new Uint8Array(length), since: new Uint8Array(length),
    number: /** @type {Packed["number"]} */ (Object.fromEntries(NUMBERS.map((name) => [name, new Float32Array(length)]))),
    figure: /** @type {Packed["figure"]} */ (Object.fromEntries(FIGURES.map((name) => [name, Float64Array.from(tracks, (track) => track[name] ?? NaN)]))),
  };
  tracks.forEach(({ points }, i) => pack(all, points, starts[i]));
  return all;
}

/** @param {Packed} all @param {Points} points @param {number} start */
function pack(all, points, start) {
  const { time, state, source, floor, turned, since, number } = all;
  for (let i = 0; i < points.t_ns.length; i++) {
    time[start + i] = points.t_ns[i] / 1e6;
    state[start + i] = numberOf(all.states, points.state[i]);
    source[start + i] = numberOf(all.sources, points.z_source[i] ?? "");
    floor[start + i] = numberOf(all.floors, points.floor[i] ?? "");
    turned[start + i] = points.frame[i] === "relative" ? 1 : 0;
    since[start + i] = BETWEEN.indexOf(points.since_previous[i]);
  }
  for (const name of NUMBERS) {
    const [column, values] = [number[name], points[name]];
    for (let i = 0; i < values.length; i++) column[start + i] = values[i] ?? NaN;
  }
  for (let i = start; i < start + points.t_ns.length; i++) if (turned[i]) number.x[i] = number.y[i] = NaN;
}

/** Return the place of a text in a list, which gets it when it lacks it. @param {string[]} texts @param {string} text */
function numberOf(texts, text) {
  const found = texts.indexOf(text);
  return found >= 0 ? found : texts.push(text) - 1;
}

/** Return what a worker need not copy. @param {Packed} all */
export const buffersOf = ({ starts, time, state, source, floor, turned, since, number, figure }) =>
  [starts, time, state, source, floor, turned, since, ...Object.values(number), ...Object.values(figure)].map(({ buffer }) => buffer);
