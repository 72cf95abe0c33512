/** Why the selected tag is taken to be where it is: what the stream does not carry, asked for as long as it is selected. */

import { api, getJson } from "./connection.js";

const ASK_MS = 500;
const LAST = 150;
const HEARD_S = 5;

/**
 * @typedef {object} Innovation as in the contract
 * @property {number} t_ns
 * @property {"range" | "bearing"} kind
 * @property {string | null} anchor
 * @property {number} measured
 * @property {number} predicted
 * @property {number} innovation
 * @property {number} variance
 * @property {boolean} fused
 *
 * @typedef {object} Explanation as in the contract, as far as the page needs it
 * @property {any} pose
 * @property {{range_rate_mps: number | null}} speed
 * @property {{t_ns: number[], speed_mps: (number | null)[]}} speed_track
 * @property {Innovation[]} innovations oldest first
 * @property {number} refused
 * @property {Record<string, number>} samples
 * @property {Record<string, number>} rejected
 */

export class Evidence extends EventTarget {
  /** @type {Explanation | null} */
  #found = null;
  /** @type {string | null} */
  #tag = null;
  #asked = -Infinity;
  #waits = false;

  /** @param {string | null} tag @returns {Explanation | null} */
  of(tag) {
    return tag === this.#tag ? this.#found : null;
  }

  /** Ask for a tag unless that was done a moment ago. @param {string} tag */
  async ask(tag) {
    if (tag !== this.#tag) [this.#tag, this.#found] = [tag, null];
    else if (this.#waits || performance.now() - this.#asked < ASK_MS) return;
    this.#asked = performance.now();
    this.#waits = true;
    const found = await getJson(api(`tags/${encodeURIComponent(tag)}/explain?last=${LAST}`)).catch(() => null);
    this.#waits = false;
    if (tag !== this.#tag) return;
    this.#found = found;
    this.dispatchEvent(new Event("change"));
  }
}

/** The last range to each anchor that was heard in the last seconds. @param {Explanation} explanation
 * @returns {Map<string, number>} m by anchor */
export function rangesHeard({ innovations }) {
  const newest = innovations.at(-1)?.t_ns ?? 0;
  const heard = innovations.filter(({ kind, anchor, t_ns }) => kind === "range" && anchor && newest - t_ns < HEARD_S * 1e9);
  return new Map(heard.map(({ anchor, measured }) => [/** @type {string} */ (anchor), measured]));
}

/** One standard deviation of the heading, rad; NaN while it is not known. @param {Explanation} explanation */
export const headingSigma = ({ pose }) => Math.sqrt(pose.covariance?.[2]?.[2] ?? NaN);

/** How fast each range changed over the two seconds before it: the tag was at least as fast as that.
 * @param {readonly Innovation[]} innovations of ranges to one anchor
 * @returns {{t_ns: number, value: number}[]} m/s, without sign */
export function leastSpeeds(innovations) {
  let from = 0;
  return innovations.flatMap(({ t_ns }, i) => {
    while (t_ns - innovations[from].t_ns > 2e9) from++;
    const slope = slopeOf(innovations.slice(from, i + 1));
    return Number.isNaN(slope) ? [] : [{ t_ns, value: Math.abs(slope) }];
  });
}

/** Of the line of least squares through the ranges, m/s; NaN for less than a second.
 * @param {readonly Innovation[]} ranges */
function slopeOf(ranges) {
  const last = ranges[ranges.length - 1];
  const times = ranges.map(({ t_ns }) => (t_ns - last.t_ns) / 1e9);
  if (ranges.length < 4 || times[0] > -0.95) return NaN;
  const middle = times.reduce((sum, t) => sum + t, 0) / times.length;
  const squares = times.reduce((sum, t) => sum + (t - middle) ** 2, 0);
  return times.reduce((sum, t, i) => sum + (t - middle) * ranges[i].measured, 0) / squares;
}
