/** The minutes before the shown time, run again with other settings: beside what was on the map, and set for good with one more click. */

import { send } from "../data/access.js";
import { api } from "../data/connection.js";
import { length, place } from "../data/format.js";
import { DOUBTFUL, TRACKING } from "../data/packed_tracks.js";
import { nanoseconds } from "../data/track_reader.js";
import { readMeasure, writeMeasure } from "../data/units.js";
import { t } from "../i18n/language.js";
import { refusal } from "../i18n/said.js";
import { drawOther } from "../map/draw_track.js";
import { fieldOf, instead, partOf, write } from "../page/parts.js";

const MINUTE_MS = 60_000;
const MOST_MS = 30 * MINUTE_MS; // that the service runs again

/** @typedef {{id: string, x: number, y: number}} Anchor */
/** @typedef {{text: string, phrase: import("../i18n/said.js").Phrase, from_ns: number, mount_angle_rad?: number, anchor?: string}} Cause as in the contract */
/** @typedef {{settings?: Record<string, any>, anchors?: Anchor[]}} Other what differs */
/** @typedef {{t_ns: number[], x: (number | null)[], y: (number | null)[], state: string[]}} Columns */

export class WhatIf {
  /** @type {Other | null} */
  #other = null;
  /** @type {import("../map/draw_track.js").Line | null} */
  #line = null;

  /** @param {HTMLFormElement} form @param {import("../data/replay.js").Replay} replay @param {import("../page/choice.js").Choice} choice
   * @param {import("../map/map.js").LiveMap} map @param {import("../data/changes.js").Changes} changes */
  constructor(form, replay, choice, map, changes) {
    this.form = form;
    this.replay = replay;
    this.choice = choice;
    this.map = map;
    this.changes = changes;
    instead(form, "submit", () => {
      const before_ms = fieldOf(form, "minutes").valueAsNumber * MINUTE_MS;
      this.run(this.#typed(), replay.time_ms - before_ms);
    });
    fieldOf(form, "anchor").addEventListener("change", () => this.#showAnchor());
    partOf(form, "apply").addEventListener("click", () => this.#apply());
    map.overlays.push((scene) => this.#line && form.checkVisibility() && drawOther(scene, this.#line, replay.time_ms));
  }

  /** Forget the last answer, and offer the anchors of the site. */
  clear() {
    this.#show(null, null, "");
    const anchors = this.map.anchors.map(({ id }) => new Option(id, id));
    fieldOf(this.form, "anchor").replaceChildren(new Option(t("whatif.as_was"), ""), ...anchors);
    this.#showAnchor();
  }

  /** Fill in what would have been right, and run it: but where an anchor was moved to, only people know. @param {Cause} cause */
  offer({ from_ns, mount_angle_rad, anchor }) {
    writeMeasure(fieldOf(this.form, "mount"), mount_angle_rad ?? null);
    fieldOf(this.form, "anchor").value = anchor ?? "";
    this.#showAnchor();
    fieldOf(this.form, "minutes").value = ((this.replay.time_ms - from_ns / 1e6) / MINUTE_MS).toFixed(3);
    if (anchor) fieldOf(this.form, "x").focus();
    else this.form.requestSubmit();
  }

  /** Run the time until the shown one again. @param {Other} other @param {number} from_ms when the tag was right */
  async run(other, from_ms) {
    const { time_ms } = this.replay;
    const tag = encodeURIComponent(this.choice.selected ?? "");
    this.#show(other, null, t("then.running"));
    try {
      const body = { from_ns: Number(nanoseconds(Math.max(from_ms, time_ms - MOST_MS))), to_ns: Number(nanoseconds(time_ms)), ...other };
      const answer = await (await send(api(`tags/${tag}/what-if`), "POST", body)).json();
      if (this.#other === other) this.#show(other, lineOf(answer.what_if), sentenceOf(other, answer));
    } catch (error) {
      if (this.#other === other) this.#show(null, null, refusal(error));
    }
  }

  /** @returns {Other} */
  #typed() {
    const [motion, anchor] = ["motion", "anchor"].map((name) => fieldOf(this.form, name).value);
    const [mount_angle_rad, x, y] = ["mount", "x", "y"].map((name) => readMeasure(fieldOf(this.form, name)));
    return {
      settings: { ...(motion && { motion }), ...(mount_angle_rad === null ? {} : { mount_angle_rad }) },
      anchors: this.map.anchors.filter(({ id }) => id === anchor).map((known) => ({ ...known, x: x ?? 0, y: y ?? 0 })),
    };
  }

  #showAnchor() {
    const anchor = this.map.anchors.find(({ id }) => id === fieldOf(this.form, "anchor").value);
    for (const name of /** @type {const} */ (["x", "y"])) {
      const field = fieldOf(this.form, name);
      writeMeasure(field, anchor?.[name] ?? null);
      field.disabled = !anchor;
    }
  }

  /** @param {Other | null} other @param {import("../map/draw_track.js").Line | null} line @param {string} text */
  #show(other, line, text) {
    [this.#other, this.#line] = [other, line];
    write(partOf(this.form, "answer"), text);
    partOf(this.form, "apply").hidden = line === null || wordsOf(other) === "" || !this.changes.mayWrite;
    this.map.redraw();
  }

  async #apply() {
    const { settings = {}, anchors = [] } = this.#other ?? {};
    const together = {};
    /** @type {[string, object][]} */
    const parts = anchors.map(({ id, x, y }) => [`anchors/${encodeURIComponent(id)}`, { x, y }]);
    if (Object.keys(settings).length > 0) parts.push([`tags/${encodeURIComponent(this.choice.selected ?? "")}/settings`, settings]);
    for (const [path, patch] of parts) await this.changes.editAsIs(t("whatif.applied", { what: wordsOf(this.#other) }), path, patch, { together });
  }
}

/** @param {Other | null} other */
const wordsOf = (other) => [
  ...Object.entries(other?.settings ?? {}).map(([name, value]) => `${name} = ${typeof value === "number" ? Number(value.toFixed(4)) : value ?? "–"}`),
  ...(other?.anchors ?? []).map(({ id, x, y }) => `${id}: ${place(x, y, 2)}`),
].join(", ");

/**
 * The place as it was may be unknown where the other one is known.
 * @param {Other} other @param {{apart_m: number | null, what_if: Columns}} answer
 */
function sentenceOf(other, { apart_m, what_if: { x, y } }) {
  const [what, last_x, last_y] = [wordsOf(other), x.at(-1) ?? null, y.at(-1) ?? null];
  if (last_x === null || last_y === null) return t("whatif.unknown", { what });
  const at = place(last_x, last_y, 2);
  return apart_m === null ? t("whatif.at", { what, place: at }) : t("whatif.would", { what, place: at, apart: length(apart_m) });
}

/** @param {Columns} columns @returns {import("../map/draw_track.js").Line} */
const lineOf = ({ t_ns, x, y, state }) => ({
  time: Float64Array.from(t_ns, (one) => one / 1e6),
  x: Float32Array.from(x, (one) => one ?? NaN),
  y: Float32Array.from(y, (one) => one ?? NaN),
  since: Uint8Array.from(state, (one) => (one === "tracking" ? TRACKING : DOUBTFUL)),
  off_m: new Float32Array(x.length),
});
