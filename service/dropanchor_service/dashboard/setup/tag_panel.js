/** The settings of the selected tag: name, colour, group, motion, mounting angle, height, start; and its deletion. */

import { readMeasure, writeMeasure } from "../data/units.js";
import { confirmed } from "./confirm.js";
import { numberOf, patchOf, fillForm } from "./tag_form.js";
import { t } from "../i18n/language.js";

/** @typedef {import("../data/changes.js").Seen} Seen */

export class TagPanel {
  /** The tag whose settings the form shows. */
  #tag = "";
  /** @type {Seen | null} */
  #seen = null;

  /** @param {HTMLElement} panel @param {HTMLDialogElement} dialog @param {import("../data/fleet.js").Fleet} fleet
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/changes.js").Changes} changes
   * @param {import("./start.js").StartEditor} start */
  constructor(panel, dialog, fleet, choice, changes, start) {
    this.panel = panel;
    this.dialog = dialog;
    this.fleet = fleet;
    this.choice = choice;
    this.changes = changes;
    this.start = start;
    this.box = /** @type {HTMLDetailsElement} */ (this.#part("settings"));
    this.form = /** @type {HTMLFormElement} */ (this.#part("settings-form"));
    this.startForm = /** @type {HTMLFormElement} */ (this.#part("start-form"));
    this.box.addEventListener("toggle", () => this.#load());
    this.form.addEventListener("submit", (event) => this.#save(event));
    this.#part("delete-tag").addEventListener("click", () => this.#delete());
    this.#part("start").addEventListener("click", () => this.#beginStart());
    this.startForm.addEventListener("input", () => this.#typedStart());
    this.startForm.addEventListener("submit", (event) => this.#saveStart(event));
    this.startForm.addEventListener("reset", () => start.cancel());
    start.addEventListener("change", () => this.#showStart());
    changes.addEventListener("access", () => this.update());
    changes.addEventListener("done", () => this.#load());
    choice.addEventListener("change", () => this.update());
    this.update();
  }

  update() {
    this.box.hidden = !this.changes.mayWrite;
    this.#part("delete-tag").hidden = !this.changes.mayDelete;
    const tag = this.choice.selected ?? "";
    if (tag === this.#tag) return;
    this.#tag = tag;
    this.start.cancel();
    this.#load();
  }

  /** @param {string} name */
  #part(name) {
    return /** @type {HTMLElement} */ (this.panel.querySelector(`[data-part="${name}"]`));
  }

  get #path() {
    return `tags/${encodeURIComponent(this.#tag)}/settings`;
  }

  /** Request the settings and show them, if the form is open. */
  async #load() {
    const tag = this.#tag;
    this.#seen = null;
    if (!tag || !this.box.open) return;
    try {
      const seen = await this.changes.read(this.#path);
      if (tag !== this.#tag) return;
      this.#seen = seen;
      fillForm(this.form, seen.value, new Set(this.fleet.groups.filter((group) => group !== "")));
    } catch {
      // A tag that was deleted has no settings. The table drops it with its next update.
    }
  }

  /** @param {Event} event */
  async #save(event) {
    event.preventDefault();
    if (!this.#seen) return;
    await this.#edit(t("setup.saved", { tag: this.#tag }), patchOf(this.form));
  }

  /** @param {string} what @param {object} patch */
  async #edit(what, patch) {
    const seen = this.#seen ?? (await this.changes.read(this.#path));
    return this.changes.edit(what, this.#path, patch, seen, () => this.#load());
  }

  #beginStart() {
    const { drawnX, drawnY, number } = this.fleet;
    const row = this.fleet.row(this.#tag);
    const heading = number.heading_rad[row];
    const isPlaced = this.fleet.hasPose(row) && !this.fleet.isTurned(row) && !Number.isNaN(drawnX[row]);
    this.start.begin(isPlaced
      ? { x: drawnX[row], y: drawnY[row], heading_rad: Number.isNaN(heading) ? null : heading }
      : { x: 0, y: 0, heading_rad: null });
    this.#startField("x").select();
  }

  /** @param {string} name */
  #startField(name) {
    return /** @type {HTMLInputElement} */ (this.startForm.elements.namedItem(name));
  }

  #showStart() {
    const { draft, degrees } = this.start;
    this.startForm.hidden = draft === null;
    this.#part("start").hidden = draft !== null;
    if (!draft) return;
    for (const name of /** @type {const} */ (["x", "y"])) writeMeasure(this.#startField(name), draft[name]);
    const heading = this.#startField("heading");
    if (numberOf(heading) !== degrees) heading.value = degrees === null ? "" : String(degrees);
  }

  #typedStart() {
    const [x, y] = ["x", "y"].map((name) => readMeasure(this.#startField(name)));
    if (x !== null && y !== null) this.start.type(x, y, numberOf(this.#startField("heading")));
  }

  /** @param {Event} event */
  async #saveStart(event) {
    event.preventDefault();
    const { draft } = this.start;
    if (!draft) return;
    if (await this.#edit(t("setup.start_set", { tag: this.#tag }), { start: { ...draft, std_m: STD_M } })) this.start.cancel();
  }

  async #delete() {
    const tag = this.#tag;
    const question = t("setup.delete_question", { tag });
    if (!(await confirmed(this.dialog, question, t("delete")))) return;
    const path = `tags/${encodeURIComponent(tag)}`;
    const { value } = await this.changes.read(`${path}/settings`);
    this.choice.select(null);
    const done = await this.changes.remove(t("setup.deleted", { tag }), path, { path: `${path}/settings`, value, conditions: {} });
    if (!done) this.choice.select(tag);
  }
}

/** How well a person knows the place on the map, one standard deviation. */
const STD_M = 0.3;
