/** The panel of the floor plans: a list, the upload of a file, and a form for the plan that is being edited. */

import { confirmed } from "../setup/confirm.js";
import { PlanPoints } from "./plan_points.js";
import { isWorldFile, worldOf } from "./world_file.js";
import { withUnits } from "../data/format.js";
import { readMeasure, writeMeasure } from "../data/units.js";
import { t } from "../i18n/language.js";
import { begun, refusal } from "../i18n/said.js";
import { fieldOf, instead, numberOf, partOf, writeOrHide } from "../page/parts.js";
import { button, line } from "../page/elements.js";

const DEGREES = 180 / Math.PI;

export class PlanPanel {
  /** Revision of the draft in the form. */
  #filled = 0;

  /** @param {HTMLElement} panel @param {HTMLElement} toggle @param {HTMLDialogElement} dialog
   * @param {import("./plan_editor.js").PlanEditor} editor @param {import("../data/changes.js").Changes} changes
   * @param {import("../page/one_panel.js").Panels} panels */
  constructor(panel, toggle, dialog, editor, changes, panels) {
    this.panel = panel;
    this.toggle = toggle;
    this.dialog = dialog;
    this.editor = editor;
    this.changes = changes;
    this.list = partOf(this.panel, "list");
    this.upload = /** @type {HTMLFormElement} */ (partOf(this.panel, "upload"));
    this.form = /** @type {HTMLFormElement} */ (partOf(this.panel, "form"));
    this.points = new PlanPoints(partOf(this.panel, "points"), editor);
    panels.add("plans", { isOpen: () => editor.isOpen, isUnsaved: () => editor.isUnsaved, saving: () => editor.saving.now, leave: () => editor.close() });
    toggle.addEventListener("click", () => panels.toggle("plans", () => editor.open()));
    partOf(this.panel, "close").addEventListener("click", () => panels.close("plans"));
    partOf(this.panel, "new").addEventListener("click", () => panels.open("plans", () => editor.discard()));
    partOf(this.panel, "delete").addEventListener("click", () => this.#delete());
    partOf(this.panel, "move").addEventListener("click", () => editor.setMode("move"));
    partOf(this.panel, "pick").addEventListener("click", () => editor.setMode("pick"));
    this.upload.addEventListener("change", () => this.#chosen());
    instead(this.upload, "submit", () => this.#send());
    this.form.addEventListener("input", (event) => this.#typed(/** @type {HTMLInputElement} */ (event.target)));
    instead(this.form, "submit", () => editor.save());
    instead(this.form, "reset", () => editor.discard());
    this.list.addEventListener("click", (event) => {
      const id = /** @type {HTMLElement} */ (event.target).closest("button")?.dataset.plan;
      if (id !== undefined && id !== editor.draft?.id) panels.open("plans", () => editor.select(id));
    });
    for (const [source, name] of /** @type {[EventTarget, string][]} */ ([[editor, "change"], [changes, "access"]])) source.addEventListener(name, () => this.#update());
    this.#update();
  }

  #update() {
    const { editor, changes } = this;
    this.toggle.hidden = !changes.mayWrite;
    this.toggle.setAttribute("aria-pressed", String(editor.isOpen));
    this.panel.hidden = !editor.isOpen;
    this.#fillList();
    this.form.hidden = editor.draft === null;
    this.upload.hidden = editor.draft !== null;
    partOf(this.panel, "new").hidden = editor.draft === null;
    partOf(this.panel, "delete").hidden = !changes.mayDelete;
    for (const mode of /** @type {const} */ (["move", "pick"])) partOf(this.panel, mode).setAttribute("aria-pressed", String(editor.mode === mode));
    writeOrHide(partOf(this.panel, "how"), editor.mode === "" ? "" : withUnits(t(editor.isBeside ? "plans.how_beside" : `plans.how_${editor.mode}`)));
    if (!editor.isOpen) this.#say("");
    if (editor.draft) this.#fillForm(editor.draft);
    this.points.update();
  }

  #fillList() {
    const { draft, store } = this.editor;
    const texts = store.plans.map(({ id, name, floor }) => (name || id) + (floor ? ` · ${floor.name}` : ""));
    const shown = JSON.stringify([texts, draft?.id]);
    if (this.list.dataset.shown === shown) return;
    this.list.dataset.shown = shown;
    this.list.replaceChildren(...store.plans.map(({ id }, i) => {
      const choose = button(texts[i], null, () => {}, "");
      choose.dataset.plan = id;
      choose.setAttribute("aria-pressed", String(id === draft?.id));
      return line(choose);
    }));
  }

  /** @param {import("./plan_editor.js").Draft} draft */
  #fillForm({ name, opacity, dark_inverted, floor, placement, image }) {
    const isOther = this.#filled !== this.editor.revision;
    this.#filled = this.editor.revision;
    if (isOther) this.#say("");
    /** @type {Record<string, string | number>} */
    const values = {
      name, opacity, floor: floor?.name ?? "", bottom: floor?.bottom_m ?? "", top: floor?.top_m ?? "",
      x: rounded(placement.x, 2), y: rounded(placement.y, 2), turn: rounded(placement.rotation_rad * DEGREES, 2),
      width: rounded(placement.m_per_px * image.width_px, 3), distance: this.editor.distance_m ?? "",
    };
    for (const [key, value] of Object.entries(values)) {
      const field = fieldOf(this.form, key);
      if (!isOther && (field === document.activeElement || isFloor(key))) continue;
      if (field.dataset.measure) writeMeasure(field, value === "" ? null : Number(value));
      else field.value = String(value);
    }
    fieldOf(this.form, "dark_inverted").checked = dark_inverted;
    this.#requireHeights();
  }

  /** A floor needs a name and both heights, or none of them. */
  #requireHeights() {
    const fields = ["floor", "bottom", "top"].map((name) => fieldOf(this.form, name));
    const isGiven = fields.some(({ value }) => value !== "");
    for (const field of fields) field.required = isGiven;
    const [, bottom, top] = fields;
    const isReversed = isGiven && top.valueAsNumber <= bottom.valueAsNumber;
    top.setCustomValidity(isReversed ? t("plans.reversed") : "");
  }

  /** @param {HTMLInputElement} field */
  #typed(field) {
    const { draft } = this.editor;
    if (!draft || field.closest("li")) return;
    const number = valueOf(field);
    if (field.name === "name") this.editor.change({ name: field.value });
    else if (field.name === "dark_inverted") this.editor.change({ dark_inverted: field.checked });
    else if (field.name === "distance") this.editor.setDistance(number !== null && number > 0 ? number : null);
    else if (isFloor(field.name)) this.editor.change({ floor: this.#floor() });
    else if (number === null || (field.name === "width" && number <= 0)) return; // the form says so when it is sent
    else if (field.name === "opacity") this.editor.change({ opacity: number });
    else this.editor.change({ placement: { ...draft.placement, ...placed(field.name, number, draft.image.width_px) } });
  }

  /** @returns {import("./plan_store.js").Floor | null} */
  #floor() {
    const [bottom, top] = ["bottom", "top"].map((name) => valueOf(fieldOf(this.form, name)));
    const name = fieldOf(this.form, "floor").value.trim();
    return name === "" || bottom === null || top === null ? null : { name, bottom_m: bottom, top_m: top };
  }

  /** Ask only what the chosen files need. */
  #chosen() {
    const files = [...(fieldOf(this.upload, "file").files ?? [])];
    const needs = { page: files.some(({ name }) => /\.pdf$/i.test(name)), crs: files.some(({ name }) => isWorldFile(name) || /\.tiff?$/i.test(name)) };
    for (const [name, isNeeded] of Object.entries(needs)) {
      const field = fieldOf(this.upload, name);
      field.disabled = !isNeeded;
      /** @type {HTMLElement} */ (field.closest("label")).hidden = !isNeeded;
    }
  }

  async #send() {
    const files = [...(fieldOf(this.upload, "file").files ?? [])];
    const [world, file] = [files.find(({ name }) => isWorldFile(name)), files.find(({ name }) => !isWorldFile(name))];
    this.#say(file ? "" : t("plans.no_image"));
    if (!file) return;
    writeOrHide(partOf(this.panel, "busy"), t("plans.reading", { file: file.name }));
    try {
      const given = new FormData(this.upload);
      const query = ["page", "crs"].map((name) => [name, String(given.get(name) ?? "")]).filter(([, value]) => value !== "");
      const note = await this.editor.add(file, { ...Object.fromEntries(query), ...(world ? { world: await worldOf(world) } : {}) });
      this.#say(note);
      this.upload.reset();
      this.#chosen();
    } catch (error) {
      this.#say(refusal(error));
    }
    writeOrHide(partOf(this.panel, "busy"), "");
  }

  /** @param {string} text */
  #say(text) {
    writeOrHide(partOf(this.panel, "problem"), begun(text));
  }

  async #delete() {
    const question = t("plans.question", { plan: this.editor.draft?.name || this.editor.draft?.id });
    if (await confirmed(this.dialog, question, t("delete"))) await this.editor.remove();
  }
}

/** @param {HTMLInputElement} field */
const valueOf = (field) => (field.dataset.measure ? readMeasure(field) : numberOf(field));

/** @param {string} name */
const isFloor = (name) => name === "floor" || name === "bottom" || name === "top";

/** @param {string} name of a field @param {number} number @param {number} width_px */
function placed(name, number, width_px) {
  if (name === "turn") return { rotation_rad: number / DEGREES };
  return name === "width" ? { m_per_px: number / width_px } : { [name]: number };
}

/** @param {number} value @param {number} decimals */
const rounded = (value, decimals) => Number(value.toFixed(decimals));
