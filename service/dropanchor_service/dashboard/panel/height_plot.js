/** A side view of the selected tag: its height over time, and the floors. */

import { length } from "../data/format.js";
import { UNKNOWN } from "../data/packed_tracks.js";
import { units } from "../data/units.js";
import { t } from "../i18n/language.js";
import { Plot } from "./plot.js";

/**
 * @typedef {{t: number, z_m: number, std_m: number, starts: boolean}} HeightAt t: s, at most 0. starts: what was before is not known
 * @typedef {{span_s: number, at_s: number, heights: HeightAt[]}} Heights the last seconds up to 0, and the shown moment in them
 */

const BAND_SIGMAS = 1.96;
const MIN_RANGE_M = 3;
const MIN_CHANGE_M = 0.01; // of a height that is not constant

export class HeightPlot {
  /** The floors, if any. @type {() => readonly import("../plan/floors.js").FloorOfSite[]} */
  floors = () => [];

  /** @param {HTMLElement} box */
  constructor(box) {
    this.box = box;
    this.plot = new Plot(/** @type {HTMLElement} */ (box.querySelector("figure")));
  }

  /** Show the heights; nothing where they do not change. @param {Heights | null} seen */
  show(seen) {
    const values = (seen?.heights ?? []).map(({ z_m }) => z_m);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    this.box.hidden = !(high - low > MIN_CHANGE_M);
    if (!seen || this.box.hidden) return;
    const { span_s, at_s, heights } = seen;
    this.plot.begin(span_s, heights.flatMap((one) => [edge(one, BAND_SIGMAS).value, edge(one, -BAND_SIGMAS).value]), MIN_RANGE_M * units.length.factor);
    this.#floors(span_s);
    for (const piece of pieces(heights)) {
      const line = (/** @type {number} */ sigmas) => piece.map((one) => edge(one, sigmas));
      this.plot.band("band", line(BAND_SIGMAS), line(-BAND_SIGMAS));
      this.plot.line("estimate", line(0));
    }
    if (at_s < 0) this.plot.upright("zero", at_s);
    this.plot.label = t("plots.heights_label", { low: length(low), high: length(high) });
  }

  /** @param {number} span_s */
  #floors(span_s) {
    for (const { name, bottom_m } of this.floors()) {
      const value = bottom_m * units.length.factor;
      if (!this.plot.shows(value)) continue;
      this.plot.line("zero", [{ t: -span_s, value }, { t: 0, value }]);
      this.plot.write(name, { t: 0, value });
    }
  }
}

/** Return the heights of the last minute. @param {import("../data/evidence.js").Explanation | null} explanation @returns {Heights | null} */
export function heightsOfMinute(explanation) {
  const track = explanation?.height_track;
  const end = track?.t_ns.at(-1);
  if (!track || end === undefined) return null;
  const heights = track.t_ns.map((t_ns, i) => ({ t: (t_ns - end) / 1e9, z_m: track.z[i] ?? NaN, std_m: track.z_std_m[i] ?? NaN, starts: false }));
  return { span_s: Math.max(1, -heights[0].t), at_s: 0, heights: known(heights) };
}

/** Return the heights of a period in the past. @param {import("../data/tracks.js").Track | null} track
 * @param {{from_ms: number, to_ms: number, time_ms: number}} period @returns {Heights | null} */
export function heightsOfTrack(track, { from_ms, to_ms, time_ms }) {
  if (!track) return null;
  const heights = Array.from(track.time, (one_ms, i) => (
    { t: (one_ms - to_ms) / 1000, z_m: track.z[i], std_m: track.z_std_m[i], starts: track.since[i] === UNKNOWN }
  ));
  return { span_s: (to_ms - from_ms) / 1000, at_s: (time_ms - to_ms) / 1000, heights: known(heights) };
}

/** @param {HeightAt[]} heights */
const known = (heights) => heights.filter(({ z_m, std_m }) => !Number.isNaN(z_m + std_m));

/** @param {HeightAt} one @param {number} sigmas */
const edge = ({ t: at, z_m, std_m }, sigmas) => ({ t: at, value: units.length.factor * (z_m + sigmas * std_m) });

/** Return the heights in pieces without a gap. @param {readonly HeightAt[]} heights */
function pieces(heights) {
  /** @type {HeightAt[][]} */
  const found = [];
  for (const one of heights) {
    if (one.starts || found.length === 0) found.push([]);
    found[found.length - 1].push(one);
  }
  return found;
}
