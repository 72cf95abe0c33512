/** The columns of the table beside the name: what stands in them, and which of them a person wants to see. */

import { UNKNOWN, age, coordinate, half, percent, speedNumber } from "../data/format.js";
import { Ticks } from "../data/ticks.js";
import { t } from "../i18n/language.js";

/** As they stand in the document. Those in `ASKED_FOR` are there only for who asks for them. */
export const COLUMNS = ["state", "x", "y", "accuracy", "speed", "zone", "floor", "battery", "stopped", "age", "online"];
const ASKED_FOR = ["zone", "floor", "battery", "stopped"];

/** @typedef {{zonesOf: (tag: string) => readonly string[], batteryOf: (tag: string) => number}} About what is known of a tag beside its pose; NaN: it is not */

/** Event: "change". */
export class Columns extends Ticks {
  /** @type {About} */
  about = { zonesOf: () => [], batteryOf: () => NaN };

  /** @param {import("../data/fleet.js").Fleet} fleet */
  constructor(fleet) {
    super("columns", COLUMNS, ASKED_FOR);
    this.fleet = fleet;
  }

  /** Return what stands in a column. @param {string} name @param {number} row @param {number} now_ms @returns {string} */
  text(name, row, now_ms) {
    const { fleet, about } = this;
    const { x, y, semi_major_m, speed_mps } = fleet.number;
    switch (name) {
      case "state": return fleet.style(row).label;
      case "x": return coordinate(x[row]);
      case "y": return coordinate(y[row]);
      case "accuracy": return half(semi_major_m[row]);
      case "speed": return speedNumber(speed_mps[row], 2);
      case "zone": return about.zonesOf(fleet.names[row]).join(", ");
      case "floor": return fleet.value.floor[row] ?? "";
      case "battery": return percentOf(about.batteryOf(fleet.names[row]));
      case "stopped": return stoppedText(fleet, row, now_ms);
      case "age": return age(fleet.age(row, now_ms));
      default: return !fleet.current ? UNKNOWN : t(fleet.online[row] ? "figure.online" : "figure.offline");
    }
  }

  /** Return by what a column that stands for itself is sorted; null for the others. @param {string} name @param {number} now_ms
   * @returns {((row: number) => number) | null} */
  value(name, now_ms) {
    const { fleet, about } = this;
    if (name === "battery") return (row) => about.batteryOf(fleet.names[row]);
    if (name === "stopped") return (row) => fleet.stoppedFor(row, now_ms);
    if (name !== "zone" && name !== "floor") return null;
    const texts = fleet.names.map((_, row) => this.text(name, row, now_ms));
    const ranks = new Map([...new Set(texts)].filter(Boolean).sort().map((text, rank) => [text, rank]));
    return (row) => ranks.get(texts[row]) ?? NaN;
  }
}

/** @param {number} share */
const percentOf = (share) => (Number.isNaN(share) ? "" : percent(share));

/** Return for how long a tag has stood; at least so long where nobody saw it stop. @param {import("../data/fleet.js").Fleet} fleet @param {number} row @param {number} now_ms */
function stoppedText(fleet, row, now_ms) {
  const seconds = fleet.stoppedFor(row, now_ms);
  if (Number.isNaN(seconds)) return "";
  return fleet.sawStop(row) ? age(seconds) : `≥ ${age(seconds)}`;
}
