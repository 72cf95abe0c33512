/** The form of the zone that is being edited. */

import { t } from "../i18n/language.js";
import { fill, valueOf } from "../page/model_fields.js";
import { fieldOf, instead, partOf, writeOrHide } from "../page/parts.js";

/** @typedef {import("./zone_store.js").Zone} Zone */

const FIELDS = /** @type {const} */ ([
  "name", "colour", "enter", "exit", "dwell_s", "delay_s", "tags", "groups", "enter_severity", "dwell_severity", "speed_severity",
  "speed_mps", "z_min_m", "z_max_m",
]);

export class ZoneForm {
  #shown = "";
  /** Whether the zone has just been read. */
  #isFresh = false;

  /** @param {HTMLFormElement} form @param {import("./editor.js").ZoneEditor} editor @param {() => void} addCorner */
  constructor(form, editor, addCorner) {
    this.form = form;
    this.editor = editor;
    instead(form, "submit", () => editor.save());
    form.addEventListener("reset", () => editor.close());
    form.addEventListener("input", () => editor.change(this.#values()));
    partOf(this.form, "corner").addEventListener("click", addCorner);
    partOf(this.form, "newer").addEventListener("click", () => editor.zone && editor.open(editor.zone.id));
    partOf(this.form, "delete").addEventListener("click", () => this.#ask(true));
    partOf(this.form, "keep").addEventListener("click", () => this.#ask(false));
    partOf(this.form, "delete-now").addEventListener("click", () => editor.remove());
    editor.addEventListener("change", () => this.update());
  }

  update() {
    const { zone, problem, conflict, isNew, revision } = this.editor;
    this.form.hidden = zone === null;
    const isNews = problem !== "" && problem !== partOf(this.form, "problem").textContent;
    writeOrHide(partOf(this.form, "problem"), problem);
    if (isNews) partOf(this.form, "problem").scrollIntoView({ block: "nearest" });
    partOf(this.form, "newer").hidden = !conflict || isNew;
    const key = zone === null ? "" : `${isNew} ${zone.id} ${revision}`;
    this.#isFresh = key !== this.#shown;
    if (this.#isFresh) partOf(this.form, "question").hidden = true;
    if (zone) this.#show(zone);
    if (zone && this.#isFresh) fieldOf(this.form, "name").focus();
    this.#shown = key;
  }

  /** @param {Zone} zone */
  #show(zone) {
    const { shape } = zone;
    const isCircle = shape.type === "circle";
    writeOrHide(partOf(this.form, "title"), this.editor.isNew ? t(`zone.new_${shape.type}`) : t("zone.title", { zone: zone.name || zone.id }));
    writeOrHide(partOf(this.form, "how"), isCircle ? circleHelp(this.editor.drawing) : polygonHelp(shape.points.length, this.editor.drawing));
    partOf(this.form, "radius").hidden = !isCircle;
    partOf(this.form, "corner").hidden = isCircle;
    partOf(this.form, "delete").hidden = this.editor.isNew || !this.editor.store.isAdmin;
    fieldOf(this.form, "radius_m").disabled = !isCircle;
    this.#fill("radius_m", isCircle ? shape.radius_m : null);
    for (const name of FIELDS) this.#fill(name, zone[name]);
  }

  /** Write a value, but not over what is being typed. @param {string} name @param {any} value */
  #fill(name, value) {
    const field = fieldOf(this.form, name);
    if (field !== document.activeElement || this.#isFresh) fill(field, value);
  }

  /** @returns {Partial<Zone>} */
  #values() {
    const { shape } = /** @type {Zone} */ (this.editor.zone);
    const radius_m = valueOf(fieldOf(this.form, "radius_m"));
    return {
      ...Object.fromEntries(FIELDS.map((name) => [name, valueOf(fieldOf(this.form, name))])),
      shape: shape.type === "circle" && radius_m !== null ? { ...shape, radius_m } : shape,
    };
  }

  /** @param {boolean} asking */
  #ask(asking) {
    partOf(this.form, "question").hidden = !asking;
    partOf(this.form, asking ? "delete-now" : "delete").focus();
  }
}

/** @param {number} corners @param {boolean} drawing */
function polygonHelp(corners, drawing) {
  if (!drawing) return t("zone.edit_polygon");
  return t(corners < 3 ? "zone.draw_polygon" : "zone.finish_polygon", { corners: t("zone.corners", { n: corners }) });
}

/** @param {boolean} drawing */
const circleHelp = (drawing) => t(drawing ? "zone.draw_circle" : "zone.edit_circle");
