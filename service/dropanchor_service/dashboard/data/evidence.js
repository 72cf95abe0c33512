/** The explanation of the selected tag's pose. The stream does not carry it, so it is requested while the tag is selected. */

import { api, getJson } from "./connection.js";
import { isLimited } from "./shared.js";

const REQUEST_MS = 500;
const INNOVATION_COUNT = 150;
const RECENT_S = 5;

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
 * @property {{t_ns: number[], z: (number | null)[], z_std_m: (number | null)[]}} height_track
 * @property {Innovation[]} innovations oldest first
 * @property {{white_m: number, lasting_m: number} | null} range_errors
 * @property {{largest: string, half_m: number, text: string, phrase: import("../i18n/said.js").Phrase} | null} uncertainty
 * @property {number} refused
 * @property {Record<string, number>} samples
 * @property {Record<string, number>} rejected
 */

export class Evidence extends EventTarget {
  /** @type {Explanation | null} */
  #explanation = null;
  /** @type {string | null} */
  #tag = null;
  #requestedAt = -Infinity;
  #isWaiting = false;

  /** True while the page shows the past: the explanation is about the present. */
  hidden = false;

  /** @param {string | null} tag @returns {Explanation | null} */
  of(tag) {
    return !this.hidden && tag === this.#tag ? this.#explanation : null;
  }

  /** Request the explanation of a tag, unless that was done a moment ago. @param {string} tag */
  async request(tag) {
    if (this.hidden || isLimited) return; // a link of a tag or a group reads no explanation
    if (tag !== this.#tag) [this.#tag, this.#explanation] = [tag, null];
    else if (this.#isWaiting || performance.now() - this.#requestedAt < REQUEST_MS) return;
    this.#requestedAt = performance.now();
    this.#isWaiting = true;
    const explanation = await getJson(api(`tags/${encodeURIComponent(tag)}/explain?last=${INNOVATION_COUNT}`)).catch(() => null);
    this.#isWaiting = false;
    if (tag !== this.#tag) return;
    this.#explanation = explanation;
    this.dispatchEvent(new Event("change"));
  }
}

/** Return the last range to each anchor with a range in the last seconds. @param {Explanation} explanation
 * @returns {Map<string, number>} m by anchor */
export function recentRanges({ innovations }) {
  const newest = innovations.at(-1)?.t_ns ?? 0;
  const recent = innovations.filter(({ kind, anchor, t_ns }) => kind === "range" && anchor && newest - t_ns < RECENT_S * 1e9);
  return new Map(recent.map(({ anchor, measured }) => [/** @type {string} */ (anchor), measured]));
}

/** Return one standard deviation of the heading in rad; NaN while it is unknown. @param {Explanation} explanation */
export const headingSigma = ({ pose }) => Math.sqrt(pose.covariance?.[2]?.[2] ?? NaN);

/** Return how fast each range changed over the two seconds before it. The tag was at least that fast.
 * @param {readonly Innovation[]} innovations of ranges to one anchor
 * @returns {{t_ns: number, value: number}[]} m/s, without sign */
export function minimumSpeeds(innovations) {
  let from = 0;
  return innovations.flatMap(({ t_ns }, i) => {
    while (t_ns - innovations[from].t_ns > 2e9) from++;
    const slope = slopeOf(innovations.slice(from, i + 1));
    return Number.isNaN(slope) ? [] : [{ t_ns, value: Math.abs(slope) }];
  });
}

/** Return the slope of the least-squares line through the ranges in m/s; NaN for less than a second.
 * @param {readonly Innovation[]} ranges */
function slopeOf(ranges) {
  const last = ranges[ranges.length - 1];
  const times = ranges.map(({ t_ns }) => (t_ns - last.t_ns) / 1e9);
  if (ranges.length < 4 || times[0] > -0.95) return NaN;
  const middle = times.reduce((sum, t) => sum + t, 0) / times.length;
  const squares = times.reduce((sum, t) => sum + (t - middle) ** 2, 0);
  return times.reduce((sum, t, i) => sum + (t - middle) * ranges[i].measured, 0) / squares;
}
