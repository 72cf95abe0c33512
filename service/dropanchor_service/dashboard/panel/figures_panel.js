/** The table of the past: what each tag did in the shown period. */

import { FIGURES, linesOf, ordered, readFigures, urlOf } from "../data/figures.js";
import { saveFile } from "../data/save_file.js";
import { count, duration, length, speed, tagCount, UNKNOWN } from "../data/format.js";
import { isSi } from "../data/units.js";
import { t } from "../i18n/language.js";
import { partOf } from "../page/parts.js";
import { button } from "../page/elements.js";

const MAX_LINES = 500;
const HEADS = ["table.tag", "figures.tracked", "figures.distance", "figures.mean", "figures.max"];

/** How each of FIGURES is written. @type {((value: number) => string)[]} */
const WRITTEN = [duration, (metres) => length(metres, 1), (mps) => speed(mps), (mps) => speed(mps)];

export class FiguresPanel {
  /** @type {{tag: string, values: (number | null)[]}[]} */
  #lines = [];
  #column = -1;
  #asked = 0;

  /** @param {HTMLElement} button @param {HTMLDialogElement} dialog @param {import("../data/replay.js").Replay} replay
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/fleet.js").Fleet} fleet
   * @param {import("../page/one_panel.js").Panels} panels */
  constructor(button, dialog, replay, choice, fleet, panels) {
    this.dialog = dialog;
    this.replay = replay;
    this.choice = choice;
    this.fleet = fleet;
    panels.addDialog("figures", dialog);
    button.addEventListener("click", () => panels.open("figures", () => this.#open()));
    partOf(this.dialog, "close").addEventListener("click", () => dialog.close());
    partOf(this.dialog, "save").addEventListener("click", () => this.#save());
    partOf(this.dialog, "si").hidden = isSi;
  }

  get #wanted() {
    const { from_ms, to_ms } = this.replay;
    return { from_ms, to_ms, group: this.choice.group };
  }

  async #open() {
    const asked = ++this.#asked;
    this.#lines = [];
    partOf(this.dialog, "table").hidden = true;
    this.#say(t("heat.loading"));
    this.dialog.showModal();
    try {
      const figures = await readFigures(this.#wanted);
      if (asked !== this.#asked) return;
      this.#lines = linesOf(figures);
      this.#column = -1;
      this.#head(figures.zones);
      this.#fill();
    } catch {
      if (asked === this.#asked) this.#say(t("figures.unreadable"));
    }
  }

  /** @param {import("../data/figures.js").Figures["zones"]} zones */
  #head(zones) {
    const names = zones.map(({ zone, name }) => (name === null ? t("figures.deleted_zone", { zone }) : name || zone));
    const cells = [...HEADS.map((key) => t(key)), ...names.map((name) => t("figures.in_zone", { name }))].map((text, at) => {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.append(button(text, null, () => this.#order(at - 1), ""));
      return cell;
    });
    partOf(this.dialog, "head").replaceChildren(...cells);
  }

  /** @param {number} column */
  #order(column) {
    this.#column = column;
    this.#fill();
  }

  #fill() {
    const shown = ordered(this.#lines, this.#column).slice(0, MAX_LINES);
    [...partOf(this.dialog, "head").children].forEach((cell, at) => {
      if (at - 1 === this.#column) cell.setAttribute("aria-sort", at === 0 ? "ascending" : "descending");
      else cell.removeAttribute("aria-sort");
    });
    partOf(this.dialog, "lines").replaceChildren(...shown.map((line) => this.#line(line)));
    partOf(this.dialog, "table").hidden = shown.length === 0;
    const who = this.choice.group === "" ? "" : `${this.choice.group}: `;
    const more = this.#lines.length > shown.length ? ` ${t("figures.more", { n: shown.length, all: count(this.#lines.length) })}` : "";
    this.#say(shown.length === 0 ? t("past.nothing") : `${who}${tagCount(this.#lines.length)}.${more}`);
  }

  /** @param {{tag: string, values: (number | null)[]}} line */
  #line({ tag, values }) {
    const row = this.fleet.row(tag);
    const line = document.createElement("tr");
    const head = Object.assign(document.createElement("th"), { scope: "row", textContent: row >= 0 ? this.fleet.labels[row] : tag });
    line.append(head, ...values.map((value, at) => {
      const written = at < FIGURES.length ? WRITTEN[at] : duration;
      return Object.assign(document.createElement("td"), { textContent: value === null ? UNKNOWN : written(value) });
    }));
    return line;
  }

  async #save() {
    await saveFile(urlOf(this.#wanted, "csv"), "figures.csv").catch(() => this.#say(t("figures.failed")));
  }

  /** @param {string} text */
  #say(text) {
    partOf(this.dialog, "answer").textContent = text;
  }
}
