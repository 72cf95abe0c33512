/** The lane of the selected tag in the past: its states and its speed over the period, and its stops, which lead there. */

import { age, percent } from "../data/format.js";
import { stopsOf } from "../data/stops.js";
import { DOUBTFUL, TRACKING, UNKNOWN } from "../data/packed_tracks.js";
import { units } from "../data/units.js";
import { keepLines } from "../alerts/lines.js";
import { t, timeText } from "../i18n/language.js";
import { partOf, write } from "../page/parts.js";
import { Plot } from "./plot.js";
import { button, line } from "../page/elements.js";

const MOST_STOPS = 100;
/** Names of what is known, and the states whose colours stand for it. */
const KNOWN = ["tracking", "doubtful", "unknown"];
const COLOURS = ["tracking", "coasting", "lost"];

/** @typedef {import("../data/tracks.js").Track} Track @typedef {import("../data/periods.js").Period} Period */

export class Lane {
  /** @type {readonly Period[]} */
  stops = [];
  /** Where the points of the shown track lie, which are read once. @type {ArrayBufferLike | null} */
  #points = null;
  #drawn = "";

  /** @param {HTMLElement} box @param {import("../data/replay.js").Replay} replay */
  constructor(box, replay) {
    this.box = box;
    this.replay = replay;
    this.plot = new Plot(/** @type {HTMLElement} */ (box.querySelector("figure")));
  }

  /** @param {Track | null} track */
  show(track) {
    this.box.hidden = !track || track.time.length < 2 || this.replay.to_ms <= this.replay.from_ms; // of a service that has just begun
    if (!track || this.box.hidden) {
      [this.stops, this.#points] = [[], null];
      return;
    }
    this.#draw(track);
    if (this.#points === track.time.buffer && this.box.dataset.tag === track.tag) return;
    [this.#points, this.box.dataset.tag, this.stops] = [track.time.buffer, track.tag, stopsOf(track)];
    write(partOf(this.box, "stops-title"), t("lane.stops", { n: this.stops.length, time: age(this.stops.reduce((sum, { from_ms, to_ms }) => sum + to_ms - from_ms, 0) / 1000) }));
    keepLines(partOf(this.box, "stops"), this.stops.slice(0, MOST_STOPS).map((stop) => ({ key: JSON.stringify(stop), make: () => this.#line(stop) })));
  }

  /** @param {Track} track */
  #draw(track) {
    const { from_ms, to_ms, time_ms } = this.replay;
    const drawn = [track.tag, track.time.length, from_ms, to_ms, Math.round(time_ms / 1000), this.box.clientWidth].join();
    if (drawn === this.#drawn) return;
    this.#drawn = drawn;
    const point = (/** @type {number} */ i) => ({ t: (track.time[i] - to_ms) / 1000, value: track.speed_mps[i] * units.velocity.factor });
    const all = Array.from(track.time, (_, i) => point(i));
    this.plot.begin((to_ms - from_ms) / 1000, [0, ...all.map(({ value }) => value).filter(Number.isFinite)], 1);
    for (const piece of pieces(track)) this.plot.line("estimate", piece.map(point).filter(({ value }) => Number.isFinite(value)));
    const spans = spansOf(track);
    for (const { known, from_ms: begin, to_ms: end } of spans) this.plot.strip(COLOURS[known], (begin - to_ms) / 1000, (end - to_ms) / 1000);
    write(partOf(this.box, "states"), shares(spans));
    this.plot.upright("zero", (time_ms - to_ms) / 1000);
    this.plot.label = t("lane.label");
  }

  /** @param {Period} stop */
  #line({ from_ms, to_ms }) {
    const clock = (/** @type {number} */ time_ms) => timeText(time_ms, { hour: "2-digit", minute: "2-digit" });
    const text = t("lane.stop", { from: clock(from_ms), to: clock(to_ms), time: age((to_ms - from_ms) / 1000) });
    return line(button(text, null, () => this.replay.seek(from_ms)));
  }
}

/** Return the indices of the points in pieces without a gap. @param {Track} track */
function pieces({ time, since }) {
  /** @type {number[][]} */
  const found = [];
  for (let i = 0; i < time.length; i++) {
    if (i === 0 || since[i] === UNKNOWN) found.push([]);
    found[found.length - 1].push(i);
  }
  return found;
}

/** Return what was known of the tag when, in order: a thinned track keeps no more of its states. @param {Track} track */
function spansOf({ time, since }) {
  /** @type {(Period & {known: number})[]} */
  const spans = [];
  for (let i = 1; i < time.length; i++) {
    const last = spans.at(-1);
    if (last?.known === since[i]) last.to_ms = time[i];
    else spans.push({ known: since[i], from_ms: time[i - 1], to_ms: time[i] });
  }
  return spans;
}

/** Return how much of the time the tag was tracked, doubtful or unknown, in words. @param {(Period & {known: number})[]} spans */
function shares(spans) {
  const of = [0, 0, 0];
  for (const { known, from_ms, to_ms } of spans) of[known] += to_ms - from_ms;
  const total = of[TRACKING] + of[DOUBTFUL] + of[UNKNOWN];
  return [TRACKING, DOUBTFUL, UNKNOWN].filter((known) => of[known] > 0).map((known) => `${t(`lane.${KNOWN[known]}`)} ${percent(of[known] / total)}`).join(", ");
}
