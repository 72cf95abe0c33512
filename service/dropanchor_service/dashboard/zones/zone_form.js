/** The form of the zone that is being edited. */

import { t } from "../i18n/language.js";
import { readMeasure, writeMeasure } from "../data/units.js";

/** @typedef {import("./zone_store.js").Zone} Zone */

const MEASURES = /** @type {const} */ (["speed_mps", "z_min_m", "z_max_m"]);

export class ZoneForm {
  #shown = "";
  /** Whether the zone has just been read. */
  #isFresh = false;

  /** @param {HTMLFormElement} form @param {import("./editor.js").ZoneEditor} editor @param {() => void} addCorner */
  constructor(form, editor, addCorner) {
    this.form = form;
    this.editor = editor;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      editor.save();
    });
    form.addEventListener("reset", () => editor.close());
    form.addEventListener("input", () => editor.change(this.#values()));
    this.#part("corner").addEventListener("click", addCorner);
    this.#part("newer").addEventListener("click", () => editor.zone && editor.open(editor.zone.id));
    this.#part("delete").addEventListener("click", () => this.#ask(true));
    this.#part("keep").addEventListener("click", () => this.#ask(false));
    this.#part("delete-now").addEventListener("click", () => editor.remove());
    editor.addEventListener("change", () => this.update());
  }

  update() {
    const { zone, problem, conflict, isNew, revision } = this.editor;
    this.form.hidden = zone === null;
    const isNews = problem !== "" && problem !== this.#part("problem").textContent;
    put(this.#part("problem"), problem);
    if (isNews) this.#part("problem").scrollIntoView({ block: "nearest" });
    this.#part("newer").hidden = !conflict || isNew;
    const key = zone === null ? "" : `${isNew} ${zone.id} ${revision}`;
    this.#isFresh = key !== this.#shown;
    if (this.#isFresh) this.#part("question").hidden = true;
    if (zone) this.#show(zone);
    if (zone && this.#isFresh) this.#field("name").focus();
    this.#shown = key;
  }

  /** @param {string} name @returns {HTMLElement} */
  #part(name) {
    return /** @type {HTMLElement} */ (this.form.querySelector(`[data-part="${name}"]`));
  }

  /** @param {string} name */
  #field(name) {
    return /** @type {HTMLInputElement} */ (this.form.elements.namedItem(name));
  }

  /** @param {Zone} zone */
  #show(zone) {
    const { shape } = zone;
    const isCircle = shape.type === "circle";
    put(this.#part("title"), this.editor.isNew ? t(`zone.new_${shape.type}`) : t("zone.title", { zone: zone.name || zone.id }));
    put(this.#part("how"), isCircle ? circleHelp(this.editor.drawing) : polygonHelp(shape.points.length, this.editor.drawing));
    this.#part("radius").hidden = !isCircle;
    this.#part("corner").hidden = isCircle;
    this.#part("delete").hidden = this.editor.isNew || !this.editor.store.isAdmin;
    for (const name of /** @type {const} */ (["enter", "exit"])) this.#field(name).checked = zone[name];
    for (const name of /** @type {const} */ (["tags", "groups"])) this.#fill(name, zone[name].join(", "));
    for (const name of /** @type {const} */ (["name", "colour", "dwell_s", "delay_s"])) this.#fill(name, String(zone[name] ?? ""));
    this.#field("radius_m").disabled = !isCircle;
    this.#measure("radius_m", isCircle ? shape.radius_m : null);
    for (const name of MEASURES) this.#measure(name, zone[name]);
  }

  /** Write a value, but not over what is being typed. @param {string} name @param {string} value */
  #fill(name, value) {
    const field = this.#field(name);
    if ((field !== document.activeElement || this.#isFresh) && field.value !== value) field.value = value;
  }

  /** @param {string} name @param {number | null} value in SI units */
  #measure(name, value) {
    if (this.#field(name) !== document.activeElement || this.#isFresh) writeMeasure(this.#field(name), value);
  }

  /** @returns {Partial<Zone>} */
  #values() {
    const number = (/** @type {string} */ name) => (this.#field(name).value === "" ? null : this.#field(name).valueAsNumber);
    const list = (/** @type {string} */ name, /** @type {RegExp} */ separator) =>
      this.#field(name).value.trim().split(separator).filter((part) => part !== "");
    const shape = /** @type {Zone} */ (this.editor.zone).shape;
    const radius_m = readMeasure(this.#field("radius_m"));
    return {
      name: this.#field("name").value, colour: this.#field("colour").value,
      enter: this.#field("enter").checked, exit: this.#field("exit").checked,
      dwell_s: number("dwell_s"), delay_s: number("delay_s") ?? 1,
      ...Object.fromEntries(MEASURES.map((name) => [name, readMeasure(this.#field(name))])),
      tags: list("tags", /[\s,]+/), groups: list("groups", /\s*,\s*/),
      shape: shape.type === "circle" && radius_m !== null ? { ...shape, radius_m } : shape,
    };
  }

  /** @param {boolean} asking */
  #ask(asking) {
    this.#part("question").hidden = !asking;
    this.#part(asking ? "delete-now" : "delete").focus();
  }
}

/** @param {number} corners @param {boolean} drawing */
function polygonHelp(corners, drawing) {
  if (!drawing) return t("zone.edit_polygon");
  return t(corners < 3 ? "zone.draw_polygon" : "zone.finish_polygon", { corners: t("zone.corners", { n: corners }) });
}

/** @param {boolean} drawing */
const circleHelp = (drawing) => t(drawing ? "zone.draw_circle" : "zone.edit_circle");

/** @param {HTMLElement} target @param {string} text */
function put(target, text) {
  if (target.textContent !== text) target.textContent = text;
  target.hidden = text === "";
}
