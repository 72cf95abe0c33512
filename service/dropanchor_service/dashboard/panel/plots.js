/** Plots of the last measurements beside the expected ones. */

import { minimumSpeeds } from "../data/evidence.js";
import { UNKNOWN, fixed, length, percent, speed as speedText } from "../data/format.js";
import { t } from "../i18n/language.js";
import { Plot } from "./plot.js";
import { units } from "../data/units.js";

/** @typedef {import("../data/evidence.js").Explanation} Explanation @typedef {import("../data/evidence.js").Innovation} Innovation
 * @typedef {import("./plot.js").Point} Point */

const MIN_SPAN_S = 5;
const BAND_SIGMAS = 1.96; // contains 19 of 20 innovations when the model is right
const MAX_SIGMAS = 6;

export class Plots {
  /** @param {HTMLElement} panel */
  constructor(panel) {
    this.panel = panel;
    const plot = (/** @type {string} */ name) => new Plot(/** @type {HTMLElement} */ (panel.querySelector(`[data-plot="${name}"]`)));
    this.range = plot("range");
    this.innovation = plot("innovation");
    this.speed = plot("speed");
  }

  /** @param {Explanation | null} explanation */
  update(explanation) {
    this.panel.hidden = !explanation?.innovations.length;
    if (!explanation || this.panel.hidden) return;
    const { innovations } = explanation;
    const end = innovations[innovations.length - 1].t_ns;
    const span = Math.max(MIN_SPAN_S, (end - innovations[0].t_ns) / 1e9);
    const before = (/** @type {number} */ t_ns) => (t_ns - end) / 1e9;
    const ranges = innovations.filter(({ kind }) => kind === "range");
    this.#ranges(ranges, span, before);
    this.#put("scatter", scatter(explanation));
    this.#innovations(innovations, span, before);
    this.#speeds(explanation, ranges, span, before);
    this.#put("span", t("plots.span", { span: `${fixed(span, 0)} s` }));
  }

  /** @param {Innovation[]} ranges @param {number} span @param {(t_ns: number) => number} before */
  #ranges(ranges, span, before) {
    const { factor } = units.length;
    const measured = ranges.map(({ t_ns, measured: value, fused }) => ({ t: before(t_ns), value: value * factor, fused }));
    this.range.begin(span, ranges.flatMap((one) => [one.measured * factor, one.predicted * factor]), 1);
    const anchors = [...new Set(ranges.map(({ anchor }) => anchor))];
    for (const anchor of anchors) this.#expected(ranges.filter((one) => one.anchor === anchor), before, anchors.length > 1);
    this.#mark(this.range, measured);
    const last = ranges.at(-1);
    this.#put("range", last ? t("plots.range", { measured: length(last.measured), expected: length(last.predicted) }) : UNKNOWN);
    this.range.label = t("plots.ranges_label", { all: ranges.length, refused: refused(ranges) });
  }

  /** Draw the expected ranges to one anchor with their 95 % band. @param {Innovation[]} ranges
   * @param {(t_ns: number) => number} before @param {boolean} named */
  #expected(ranges, before, named) {
    const line = (/** @type {number} */ sigmas) => ranges.map(({ t_ns, predicted, variance }) => (
      { t: before(t_ns), value: units.length.factor * (predicted + sigmas * Math.sqrt(variance)) }
    ));
    this.range.band("band", line(BAND_SIGMAS), line(-BAND_SIGMAS));
    this.range.line("expected", line(0));
    const last = line(0).at(-1);
    if (named && last) this.range.write(ranges[0].anchor ?? "", last);
  }

  /** @param {Innovation[]} innovations @param {number} span @param {(t_ns: number) => number} before */
  #innovations(innovations, span, before) {
    const points = innovations.map(({ t_ns, innovation, variance, fused }) => (
      { t: before(t_ns), value: Math.max(-MAX_SIGMAS, Math.min(MAX_SIGMAS, innovation / Math.sqrt(variance))), fused }
    ));
    this.innovation.begin(span, [...points.map(({ value }) => value), -3, 3], 6);
    const edge = (/** @type {number} */ value) => [{ t: -span, value }, { t: 0, value }];
    this.innovation.band("band", edge(BAND_SIGMAS), edge(-BAND_SIGMAS));
    this.innovation.line("zero", edge(0));
    this.#mark(this.innovation, points);
    const within = points.filter(({ value }) => Math.abs(value) <= BAND_SIGMAS).length;
    const share = points.length ? percent(within / points.length) : UNKNOWN;
    this.#put("innovation", t("plots.innovations", { share, refused: refused(innovations), all: innovations.length }));
    this.innovation.label = t("plots.innovations_label", { share });
  }

  /** @param {Explanation} explanation @param {Innovation[]} ranges @param {number} span
   * @param {(t_ns: number) => number} before */
  #speeds({ pose, speed, speed_track: track }, ranges, span, before) {
    const { factor } = units.velocity;
    const speeds = track.t_ns
      .map((t_ns, i) => ({ t: before(t_ns), value: factor * (track.speed_mps[i] ?? NaN) }))
      .filter(({ t, value }) => t >= -span && t <= 0 && !Number.isNaN(value));
    const anchor = ranges.at(-1)?.anchor;
    const used = ranges.filter((one) => one.fused && one.anchor === anchor);
    const minimum = minimumSpeeds(used).map(({ t_ns, value }) => ({ t: before(t_ns), value: factor * value }));
    this.speed.begin(span, [0, ...[...speeds, ...minimum].map(({ value }) => value)], 1);
    this.speed.band("least", minimum, minimum.map(({ t }) => ({ t, value: 0 })));
    this.speed.line("estimate", speeds);
    const rate = speed.range_rate_mps;
    const now = speedText(pose.speed_mps);
    const text = rate === null ? now : t("plots.speed", { speed: now, rate: speedText(rate) });
    this.#put("speed", text);
    this.speed.label = t("plots.speed_label", { speed: text });
  }

  /** Mark used measurements with dots and refused ones with crosses. @param {Plot} plot
   * @param {(Point & {fused: boolean})[]} points */
  #mark(plot, points) {
    plot.dots("measured", points.filter(({ fused }) => fused));
    plot.crosses("refused", points.filter(({ fused }) => !fused));
  }

  /** @param {string} name @param {string} text */
  #put(name, text) {
    const element = /** @type {HTMLElement} */ (this.panel.querySelector(`[data-text="${name}"]`));
    if (element.textContent !== text) element.textContent = text;
  }
}

/** Return how much the ranges scatter, and how much of it lasts. @param {Explanation} explanation */
function scatter({ range_errors: errors }) {
  if (!errors) return "";
  const all = length(Math.hypot(errors.white_m, errors.lasting_m));
  return errors.lasting_m > errors.white_m ? t("plots.scatter_lasting", { all, lasting: length(errors.lasting_m) }) : t("plots.scatter", { all });
}

/** @param {readonly Innovation[]} innovations */
const refused = (innovations) => innovations.filter(({ fused }) => !fused).length;
