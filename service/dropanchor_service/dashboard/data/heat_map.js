/** The heat map: for how long tags were where in a period. (The density of a crowd on the map is something else.) */

import { api } from "./connection.js";
import { request } from "./access.js";
import { nanoseconds, onlyTag } from "./track_reader.js";
import { t } from "../i18n/language.js";

const TIMEOUT_MS = 30_000;
/** The scale reaches down to this share of its highest value. */
const RANGE = 1000;

/**
 * @typedef {object} Heat as in the contract
 * @property {number} tags
 * @property {number} cell_m
 * @property {number} placed_s
 * @property {number} left_out_s
 * @property {{x: number[], y: number[], seconds: number[]}} cells
 *
 * @typedef {{from_ms: number, to_ms: number, tag: string | null, group: string}} Wanted
 */

/** Event: "change". */
export class HeatMap extends EventTarget {
  active = false;
  /** @type {Heat | null} */
  heat = null;
  /** @type {Scale | null} */
  scale = null;
  problem = "";
  loading = false;
  /** @type {Wanted | null} */
  wanted = null;
  #asked = new AbortController();

  /** Show the heat of a period, unless it is shown already. @param {Wanted} wanted */
  async show(wanted) {
    if (this.active && JSON.stringify(wanted) === JSON.stringify(this.wanted)) return;
    this.hide();
    [this.active, this.wanted, this.loading] = [true, wanted, true];
    this.#changed();
    const { signal } = this.#asked;
    try {
      const heat = await (await request(urlOf(wanted), { signal: AbortSignal.any([signal, AbortSignal.timeout(TIMEOUT_MS)]) })).json();
      if (!signal.aborted) this.#take(heat);
    } catch {
      if (!signal.aborted) this.problem = t("heat.unreadable");
    }
    if (signal.aborted) return;
    this.loading = false;
    this.#changed();
  }

  hide() {
    this.#asked.abort();
    this.#asked = new AbortController();
    [this.active, this.loading, this.problem] = [false, false, ""];
    this.heat = this.scale = this.wanted = null;
    this.#changed();
  }

  /** @param {Heat} heat */
  #take(heat) {
    this.heat = heat;
    this.scale = heat.cells.seconds.length > 0 ? new Scale(heat.cells.seconds) : null;
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}

/** A logarithmic scale from 0 to 1: a place where a tag works is as visible as one where it parks. */
export class Scale {
  /** @param {readonly number[]} seconds */
  constructor(seconds) {
    const least = seconds.reduce((a, b) => Math.min(a, b));
    this.high = seconds.reduce((a, b) => Math.max(a, b));
    this.low = Math.max(least, this.high / RANGE);
  }

  /** Return the place of a time on the scale; all that is lower is 0. @param {number} seconds */
  of(seconds) {
    if (this.high === this.low) return 1;
    return Math.max(0, Math.log(seconds / this.low) / Math.log(this.high / this.low));
  }

  /** Return the times at the start, the middle and the end. */
  get marks() {
    return [this.low, Math.sqrt(this.low * this.high), this.high];
  }
}

/** Return the share of the time that the tags were at no place of the map; NaN without any time. @param {Heat} heat */
export const leftOut = ({ placed_s, left_out_s }) => left_out_s / (placed_s + left_out_s);

/** Return the index of the cell with the most time; −1 without any. @param {Heat} heat */
export const hottest = ({ cells: { seconds } }) => seconds.reduce((best, value, i) => (best < 0 || value > seconds[best] ? i : best), -1);

/** @param {Wanted} wanted */
function urlOf({ from_ms, to_ms, tag, group }) {
  const url = api("heat-map");
  const which = tag !== null ? onlyTag(tag) : group !== "" ? [["group", group]] : [];
  url.search = new URLSearchParams([["from", nanoseconds(from_ms)], ["to", nanoseconds(to_ms)], ...which]).toString();
  return url;
}
