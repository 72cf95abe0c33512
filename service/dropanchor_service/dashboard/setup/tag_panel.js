/** The settings of the selected tag, its start, and its deletion. */

import { readMeasure, writeMeasure } from "../data/units.js";
import { Saving } from "../data/saving.js";
import { confirmed } from "./confirm.js";
import { fillForm, makeFields, noteSent, patchOf, showRefused, showSources, typedIn } from "./tag_form.js";
import { t } from "../i18n/language.js";
import { fieldOf, instead, numberOf, partOf } from "../page/parts.js";

/** @typedef {import("../data/changes.js").Seen} Seen */

export class TagPanel {
  /** The tag whose settings the form shows. */
  #tag = "";
  /** @type {Seen | null} */
  #seen = null;
  /** The tag whose settings the form was filled with. */
  #filled = "";
  /** Ends when the form has its fields. @type {Promise<void> | null} */
  #made = null;
  /** The latest request for the settings. */
  #loading = Promise.resolve();
  #saving = new Saving();

  /** @param {HTMLElement} panel @param {HTMLDialogElement} dialog @param {import("../data/fleet.js").Fleet} fleet
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/changes.js").Changes} changes
   * @param {import("./start.js").StartEditor} start @param {import("../page/one_panel.js").Panels} panels */
  constructor(panel, dialog, fleet, choice, changes, start, panels) {
    this.panel = panel;
    this.dialog = dialog;
    this.fleet = fleet;
    this.choice = choice;
    this.changes = changes;
    this.start = start;
    this.box = /** @type {HTMLDetailsElement} */ (partOf(this.panel, "settings"));
    this.form = /** @type {HTMLFormElement} */ (partOf(this.panel, "settings-form"));
    this.startForm = /** @type {HTMLFormElement} */ (partOf(this.panel, "start-form"));
    panels.add("tag", {
      isOpen: () => choice.selected !== null, isUnsaved: () => this.#isTyped || start.isUnsaved,
      saving: () => this.#saving.now, leave: () => choice.select(null),
    });
    panels.add("start", { isOpen: () => start.draft !== null, isUnsaved: () => start.isUnsaved, saving: () => this.#saving.now, leave: () => start.cancel() });
    this.box.addEventListener("toggle", () => this.#seen === null && this.#load());
    instead(this.form, "submit", () => this.#save());
    partOf(this.panel, "delete-tag").addEventListener("click", () => this.#delete());
    partOf(this.panel, "start").addEventListener("click", () => panels.open("start", () => this.#beginStart()));
    this.startForm.addEventListener("input", () => this.#typedStart());
    instead(this.startForm, "submit", () => this.#saveStart());
    this.startForm.addEventListener("reset", () => start.cancel());
    start.addEventListener("change", () => this.#showStart());
    changes.addEventListener("failed", (event) => this.#saving.now && showRefused(this.form, /** @type {CustomEvent} */ (event).detail));
    changes.addEventListener("access", () => this.update());
    changes.addEventListener("done", (event) => /** @type {CustomEvent} */ (event).detail === this.#path && this.#load());
    choice.addEventListener("change", () => this.update());
    this.update();
  }

  update() {
    partOf(this.panel, "actions").hidden = !this.changes.mayWrite;
    partOf(this.panel, "delete-tag").hidden = !this.changes.mayDelete;
    const tag = this.choice.selected ?? "";
    if (tag === this.#tag) return;
    this.#tag = tag;
    this.start.cancel();
    this.#load();
  }

  get #isTyped() {
    return this.#seen !== null && Object.keys(patchOf(this.form)).length > 0;
  }

  get #path() {
    return `tags/${encodeURIComponent(this.#tag)}/settings`;
  }

  /** Request the settings and show them, if the form is open. @param {boolean} [keep] what is typed and not saved */
  #load(keep = true) {
    this.#loading = this.#read(keep);
  }

  /** @param {boolean} keep */
  async #read(keep) {
    const tag = this.#tag;
    if (tag !== this.#filled || !this.box.open) this.#seen = null;
    if (!tag || !this.box.open) return;
    try {
      await this.#fields();
      const seen = await this.changes.read(this.#path);
      if (tag !== this.#tag) return;
      const typeAgain = keep && tag === this.#filled ? typedIn(this.form) : () => false;
      fillForm(this.form, seen.value);
      const isOvertaken = typeAgain(); // then what was read before stays, so that saving asks
      this.#seen = isOvertaken && this.#seen ? this.#seen : seen;
      this.#filled = tag;
      this.#offerGroups();
      await showSources(this.form, tag);
    } catch {
      // A tag that was deleted has no settings. The table drops it with its next update.
    }
  }

  #fields() {
    return (this.#made ??= makeFields(this.form).catch((error) => {
      this.#made = null;
      throw error;
    }));
  }

  #offerGroups() {
    fieldOf(this.form, "group").setAttribute("list", "groups");
    const groups = new Set(this.fleet.groups.filter((group) => group !== ""));
    partOf(this.form, "groups").replaceChildren(...[...groups].sort().map((group) => new Option(group)));
  }

  /** Save what is typed, once an earlier change is saved and shown. */
  async #save() {
    const tag = this.#tag;
    await this.#saving.now;
    await this.#loading;
    if (!this.#seen || tag !== this.#tag) return;
    const patch = patchOf(this.form);
    noteSent(this.form, true);
    const isSaved = await this.#saving.until(this.#edit(t("setup.saved", { tag }), patch));
    if (!isSaved && tag === this.#tag) noteSent(this.form, false);
  }

  /** @param {string} what @param {object} patch @param {import("../data/changes.js").More} [more] */
  async #edit(what, patch, more) {
    await this.#loading;
    const seen = this.#seen ?? (await this.changes.read(this.#path));
    return this.changes.edit(what, this.#path, patch, seen, () => this.#load(false), more);
  }

  #beginStart() {
    const { drawnX, drawnY } = this.fleet;
    const row = this.fleet.row(this.#tag);
    if (this.#isPlaced(row)) this.#beginAt(drawnX[row], drawnY[row]);
    else this.start.begin({ x: 0, y: 0, heading_rad: null });
    fieldOf(this.startForm, "x").select();
  }

  /** @param {number} row */
  #isPlaced(row) {
    return this.fleet.hasPose(row) && !this.fleet.isTurned(row) && !Number.isNaN(this.fleet.drawnX[row]);
  }

  /** Begin at a place, with the heading that the tag has there. @param {number} x m @param {number} y m */
  #beginAt(x, y) {
    const row = this.fleet.row(this.#tag);
    const heading = this.fleet.number.heading_rad[row];
    this.start.begin({ x, y, heading_rad: !this.#isPlaced(row) || Number.isNaN(heading) ? null : heading });
  }

  /** Say that the selected tag is at a place: one more press sets the start. @param {number} x m @param {number} y m */
  beginStartAt(x, y) {
    this.box.open = true;
    this.#beginAt(x, y);
    const button = /** @type {HTMLElement} */ (this.startForm.querySelector("button"));
    button.scrollIntoView({ block: "nearest" });
    button.focus();
  }

  /** Open the settings of the selected tag. */
  async openSettings() {
    this.box.open = true;
    await this.#fields();
    const name = /** @type {HTMLElement} */ (this.form.elements.namedItem("name"));
    name.scrollIntoView({ block: "nearest" });
    name.focus();
  }

  #showStart() {
    const { draft, degrees } = this.start;
    this.startForm.hidden = draft === null;
    partOf(this.panel, "start").hidden = draft !== null;
    if (!draft) return;
    for (const name of /** @type {const} */ (["x", "y"])) writeMeasure(fieldOf(this.startForm, name), draft[name]);
    const heading = fieldOf(this.startForm, "heading");
    if (numberOf(heading) !== degrees) heading.value = degrees === null ? "" : String(degrees);
  }

  #typedStart() {
    const [x, y] = ["x", "y"].map((name) => readMeasure(fieldOf(this.startForm, name)));
    if (x !== null && y !== null) this.start.type(x, y, numberOf(fieldOf(this.startForm, "heading")));
  }

  async #saveStart() {
    const { draft } = this.start;
    if (!draft) return;
    const started = { tag: this.#tag, since_ms: performance.now() };
    const what = t("setup.start_set", { tag: this.#tag });
    if (await this.#saving.until(this.#edit(what, { start: { ...draft, std_m: STD_M } }, { started }))) this.start.cancel();
  }

  async #delete() {
    const tag = this.#tag;
    const question = t("setup.delete_question", { tag });
    if (!(await confirmed(this.dialog, question, t("delete")))) return;
    const path = this.#path;
    this.choice.select(null);
    const done = await this.changes.remove(t("setup.deleted", { tag }), path);
    if (!done) this.choice.select(tag);
  }
}

/** How well a person knows the place on the map, one standard deviation. */
const STD_M = 0.3;
