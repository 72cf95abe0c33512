/** The dialog of settings and changes: where values come from, who changed what, and how to take either back. */

import { bringBack, differences, giveBackOf, NewerError, readEntries, readSettings, sourceOf, trailUrl, undoOf } from "../data/trail.js";
import { saveFile } from "../data/save_file.js";
import { t, timeText } from "../i18n/language.js";
import { refusal } from "../i18n/said.js";
import { ChangedMeanwhileError } from "../data/access.js";
import { partOf, writeOrHide } from "./parts.js";
import { button, element, line } from "./elements.js";

/** @typedef {import("../data/trail.js").Entry} Entry @typedef {import("../data/trail.js").Setting} Setting @typedef {import("../data/trail.js").Held} Held */

const SHOWN = 3; // values of an entry
const LENGTH = 60; // of a value

export class TrailPanel {
  /** @type {number | null} */
  #next = null;

  /** @param {HTMLDialogElement} dialog @param {import("../data/changes.js").Changes} changes */
  constructor(dialog, changes) {
    this.dialog = dialog;
    this.changes = changes;
    partOf(this.dialog, "more").addEventListener("click", () => this.#attempt(() => this.#readMore()));
    for (const format of /** @type {const} */ (["csv", "jsonl"])) {
      partOf(this.dialog, format).addEventListener("click", () => this.#attempt(() => saveFile(trailUrl(format), `changes.${format}`)));
    }
  }

  open() {
    this.dialog.showModal();
    return this.#attempt(() => this.#refresh());
  }

  async #refresh() {
    const settings = await readSettings();
    partOf(this.dialog, "values").replaceChildren(...settings.map((setting) => this.#setting(setting)));
    partOf(this.dialog, "no-values").hidden = settings.length > 0;
    partOf(this.dialog, "entries").replaceChildren();
    this.#next = null;
    await this.#readMore();
  }

  async #readMore() {
    const { entries, next } = await readEntries(this.#next);
    this.#next = next;
    partOf(this.dialog, "entries").append(...entries.map((entry) => this.#entry(entry)));
    partOf(this.dialog, "more").hidden = next === null;
    partOf(this.dialog, "no-entries").hidden = partOf(this.dialog, "entries").childElementCount > 0;
  }

  /** @param {Setting} setting */
  #setting(setting) {
    const name = setting.path.join(" › ");
    const values = { name, value: written(setting.value), source: sourceOf(setting, setting.path) };
    const [hidden] = setting.hides;
    const text = hidden && hidden.source !== "default"
      ? t("trail.hides", { ...values, hidden: written(hidden.value), from: sourceOf(hidden, setting.path) })
      : t("trail.value", values);
    const act = setting.source === "rest" ? () => bringBack(this.changes, t("trail.gave_back", { name }), giveBackOf(setting)) : null;
    return this.#line(text, t("trail.give_back"), t("trail.give_back_one", { name }), act);
  }

  /** @param {Entry} entry */
  #entry(entry) {
    const what = `${t(`trail.kind_${entry.kind}`)} ${entry.item}`;
    const time = timeText(entry.t_ns / 1e6, { dateStyle: "short", timeStyle: "medium" });
    const values = { who: entry.by.name || t(`trail.by_${entry.by.source}`), what, time, values: changesOf(entry) };
    const text = t(entry.after === null ? "trail.deleted" : entry.before === null ? "trail.made" : "trail.changed", values);
    const back = entry.confirmed ? undoOf(entry) : null;
    const act = back ? () => bringBack(this.changes, t("trail.undid", { what }), back) : null;
    const note = entry.confirmed ? "" : ` ${t("trail.unconfirmed")}`;
    return this.#line(`${text}${note}`, t("outcome.undo"), t("trail.undo_one", { what, time }), act);
  }

  /** @param {string} text @param {string} label of its button @param {string} spoken @param {(() => Promise<void>) | null} act */
  #line(text, label, spoken, act) {
    if (act === null || !this.changes.mayWrite) return line(element("span", text));
    return line(element("span", text), button(label, spoken, () => this.#attempt(async () => {
      await act();
      await this.#refresh();
      partOf(this.dialog, "values").focus();
    })));
  }

  /** @param {() => Promise<void>} act */
  async #attempt(act) {
    let problem = "";
    try {
      await act();
    } catch (error) {
      problem = error instanceof NewerError || error instanceof ChangedMeanwhileError ? t("trail.newer") : refusal(error);
    }
    writeOrHide(partOf(this.dialog, "problem"), problem);
  }
}

/** @param {Entry} entry */
function changesOf({ before, after }) {
  const found = differences(before, after);
  const parts = found.slice(0, SHOWN).map(([key, one, other]) => `${key}: ${written(one)} → ${written(other)}`);
  return parts.join("; ") + (found.length > SHOWN ? "; …" : "");
}

/** @param {object} value */
const partsOf = (value) => Object.entries(value).filter(([key, part]) => key !== "id" && part !== null).map(([key, part]) => `${key} ${JSON.stringify(part)}`).join(", ");

/** @param {any} value */
function written(value) {
  if (value === null || value === undefined) return t("trail.nothing");
  const text = typeof value === "object" && !Array.isArray(value) ? partsOf(value) : typeof value === "string" && value !== "" ? value : JSON.stringify(value);
  return text.length > LENGTH ? `${text.slice(0, LENGTH)}…` : text;
}
