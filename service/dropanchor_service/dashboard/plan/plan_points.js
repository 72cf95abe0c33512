/** The list of points by which a plan is aligned: where each is, and how far the plan is off there. */

import { length } from "../data/format.js";
import { readMeasure, units, writeMeasure } from "../data/units.js";
import { t } from "../i18n/language.js";
import { toCentimetre } from "../setup/gestures.js";
import { latLonIn, siteOfLatLon } from "./geodesy.js";
import { isPlaced, residuals } from "./transform.js";
import { button, element, line } from "../page/elements.js";

/** Fewer points always fit exactly, so that their residuals say nothing. */
const RESIDUALS_FROM = 3;

export class PlanPoints {
  #shown = "";

  /** @param {HTMLElement} box @param {import("./plan_editor.js").PlanEditor} editor */
  constructor(box, editor) {
    this.editor = editor;
    this.list = /** @type {HTMLElement} */ (box.querySelector("ol"));
    this.residual = /** @type {HTMLElement} */ (box.querySelector('[data-part="residual"]'));
    this.distance = /** @type {HTMLElement} */ (box.querySelector('[data-part="distance"]'));
  }

  update() {
    const { draft, map } = this.editor;
    if (!draft) return;
    const { points } = draft;
    const shown = JSON.stringify([draft.id, points.length, map.anchors, this.editor.georeference]);
    if (shown !== this.#shown) this.list.replaceChildren(...points.map((_, i) => this.#line(i)));
    this.#shown = shown;
    this.distance.hidden = points.length < 2 || points.filter(isPlaced).length > 1;
    const off = residuals(draft.placement, draft.image, points);
    const known = off.filter((one) => one !== null);
    const isTelling = known.length >= RESIDUALS_FROM || known.some((one) => one > 0.01);
    points.forEach((point, i) => this.#fill(i, point, isTelling ? off[i] : null));
    this.residual.textContent = isTelling ? t("plans.off_at_most", { distance: length(Math.max(...known)) }) : "";
  }

  /** @param {number} index */
  #line(index) {
    const [x, y] = ["x", "y"].map((axis) => Object.assign(document.createElement("input"), { type: "number", step: "any", placeholder: `${axis} ${units.length.symbol}`, ariaLabel: t("plans.point_axis", { number: index + 1, axis, unit: units.length.symbol }) }));
    for (const field of [x, y]) field.dataset.measure = "length";
    for (const field of [x, y]) field.addEventListener("input", () => this.editor.placePoint(index, readMeasure(x), readMeasure(y)));
    const off = document.createElement("small");
    const remove = button(t("plans.remove"), t("plans.remove_one", { number: index + 1 }), () => this.editor.removePoint(index));
    return line(element("span", `${index + 1}`), x, y, this.#anchors(index), off, remove, this.#latLon(index));
  }

  /** Return a field for latitude and longitude. @param {number} index */
  #latLon(index) {
    const { georeference } = this.editor;
    const field = Object.assign(document.createElement("input"), { className: "lat-lon", placeholder: t("plans.lat_lon"), ariaLabel: t("plans.lat_lon_label", { number: index + 1 }), autocomplete: "off", hidden: georeference === null });
    field.addEventListener("input", () => {
      const found = latLonIn(field.value);
      if (!found || !georeference) return;
      this.editor.mode = "";
      this.editor.placePoint(index, .../** @type {[number, number]} */ (siteOfLatLon(georeference, found).map(toCentimetre)));
    });
    return field;
  }

  /** Return a choice of the anchors as places. @param {number} index */
  #anchors(index) {
    const { anchors } = this.editor.map;
    const select = Object.assign(document.createElement("select"), { ariaLabel: t("plans.anchor_label", { number: index + 1 }), hidden: anchors.length === 0 });
    select.append(new Option(t("plans.at_anchor"), ""), ...anchors.map(({ id }) => new Option(id)));
    select.addEventListener("change", () => {
      const anchor = anchors.find(({ id }) => id === select.value);
      if (!anchor) return;
      this.editor.mode = "";
      this.editor.placePoint(index, anchor.x, anchor.y);
    });
    return select;
  }

  /** @param {number} index @param {import("./transform.js").Point} point @param {number | null} off_m null: it says nothing */
  #fill(index, point, off_m) {
    const [, x, y, anchor, off] = this.list.children[index].children;
    for (const [field, value] of /** @type {[HTMLInputElement, number | null][]} */ ([[x, point.x], [y, point.y]])) {
      if (field !== document.activeElement) writeMeasure(field, value);
    }
    const at = this.editor.map.anchors.find((one) => one.x === point.x && one.y === point.y);
    /** @type {HTMLSelectElement} */ (anchor).value = at?.id ?? "";
    off.textContent = off_m === null ? "" : t("plans.off", { distance: length(off_m) });
  }
}
