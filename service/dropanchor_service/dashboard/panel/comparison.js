/** The selected tags side by side. */

import { UNKNOWN, half, length, percent, place, speed } from "../data/format.js";
import { t } from "../i18n/language.js";
import { hintOf } from "./hint.js";
import { units } from "../data/units.js";
import { write } from "../page/parts.js";

/** @typedef {{name: string, title: string, text: (row: number) => string}} Column */

export class Comparison {
  #shape = "";

  /** @param {HTMLTableElement} table @param {import("../data/fleet.js").Fleet} fleet @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice */
  constructor(table, fleet, roster, choice) {
    this.table = table;
    this.fleet = fleet;
    this.roster = roster;
    this.choice = choice;
  }

  /** @param {readonly string[]} tags */
  update(tags) {
    const rows = tags.map((tag) => this.fleet.row(tag)).filter((row) => row >= 0);
    const columns = this.#columns().filter(({ name, text }) => name !== "battery" || rows.some((row) => text(row) !== UNKNOWN));
    const lines = rows.map((row) => columns.map(({ text }) => text(row)));
    const [head, body] = [this.table.createTHead(), this.table.tBodies[0] ?? this.table.createTBody()];
    const shape = JSON.stringify([columns.map(({ name }) => name), rows.length]);
    if (shape !== this.#shape) {
      this.#shape = shape;
      head.replaceChildren(lineOf(columns.map(({ title }) => title), "col"));
      body.replaceChildren(...lines.map((texts) => lineOf(texts, "row")));
    }
    rows.forEach((row, at) => body.rows[at].cells[0].style.setProperty("--mark", this.choice.colourOf(this.fleet.names[row])));
    lines.forEach((texts, at) => texts.forEach((text, place) => write(body.rows[at].cells[place], text))); // the cells stay, and so does what is marked in them
  }

  /** @returns {Column[]} */
  #columns() {
    const { fleet, roster } = this;
    const number = fleet.number;
    return [
      { name: "tag", title: t("table.tag"), text: (row) => fleet.labels[row] },
      { name: "state", title: t("table.state"), text: (row) => fleet.style(row).label },
      { name: "place", title: t("several.place"), text: (row) => (Number.isNaN(number.x[row]) ? UNKNOWN : place(number.x[row], number.y[row], 2)) },
      { name: "accuracy", title: t("figure.accuracy"), text: (row) => (Number.isNaN(number.semi_major_m[row]) ? UNKNOWN : `± ${half(number.semi_major_m[row])} ${units.length.symbol}`) },
      { name: "speed", title: t("figure.speed"), text: (row) => (Number.isNaN(number.speed_mps[row]) ? UNKNOWN : speed(number.speed_mps[row])) },
      { name: "range", title: t("several.range"), text: (row) => length(number.range_m[row]) },
      { name: "battery", title: t("health.battery"), text: (row) => percent(roster.of(fleet.names[row])?.health?.battery_fraction) },
      { name: "hint", title: t("several.hint"), text: (row) => (fleet.current ? hintOf(fleet, roster, row) : "") },
    ];
  }
}

/** @param {readonly string[]} texts @param {"col" | "row"} scope the cells are heads of columns, or only the first is, of its row */
function lineOf(texts, scope) {
  const line = document.createElement("tr");
  line.append(...texts.map((textContent, place) => {
    const isHead = scope === "col" || place === 0;
    return Object.assign(document.createElement(isHead ? "th" : "td"), { textContent, ...(isHead ? { scope } : {}) });
  }));
  return line;
}
