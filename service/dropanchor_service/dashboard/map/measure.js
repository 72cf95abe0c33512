/** Measure distances and bearings between points that a person clicks on the map. */

import { compass, length } from "../data/format.js";
import { haloText } from "./draw_site.js";
import { t } from "../i18n/language.js";

/** @typedef {[number, number]} Point m */
/** @typedef {import("./map.js").LiveMap} LiveMap */

/** Return the length of each leg in m, and its direction counter-clockwise from the x axis. @param {readonly Point[]} points */
export function legsOf(points) {
  return points.slice(1).map(([x, y], i) => {
    const [dx, dy] = [x - points[i][0], y - points[i][1]];
    return { length_m: Math.hypot(dx, dy), angle_rad: Math.atan2(dy, dx) };
  });
}

/** Return the result as a sentence. @param {readonly Point[]} points @param {number} rotation_rad of the x axis from east */
export function sentence(points, rotation_rad) {
  const legs = legsOf(points);
  const last = legs.at(-1);
  if (!last) return t("measure.how");
  const leg = t("measure.leg", { length: length(last.length_m), bearing: compass(last.angle_rad + rotation_rad) });
  const total_m = legs.reduce((sum, { length_m }) => sum + length_m, 0);
  return legs.length === 1 ? leg : t("measure.total", { leg, total: length(total_m) });
}

export class Measure {
  /** Direction of the x axis, counter-clockwise from east. */
  rotation_rad = 0;
  /** @type {Point[]} */
  #points = [];

  /** @param {LiveMap} map @param {HTMLElement} button @param {HTMLElement} answer @param {import("../page/one_panel.js").Panels} panels */
  constructor(map, button, answer, panels) {
    this.map = map;
    this.button = button;
    this.answer = answer;
    panels.add("measure", { isOpen: () => this.active, leave: () => this.turn(false) });
    button.addEventListener("click", () => panels.toggle("measure", () => this.turn(true)));
    map.overlays.push((scene) => this.#draw(scene));
    map.canvas.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && this.press(map.view.width / 2, map.view.height / 2)) event.preventDefault();
    });
  }

  get active() {
    return this.button.getAttribute("aria-pressed") === "true";
  }

  /** @param {boolean} on */
  turn(on) {
    this.button.setAttribute("aria-pressed", String(on));
    this.#points = [];
    this.#update();
  }

  /** Begin to measure at a point. @param {number} x m @param {number} y m */
  from(x, y) {
    this.turn(true);
    this.#points.push([x, y]);
    this.#update();
  }

  /** Add a point while measuring. Return whether the press was for this. @param {number} px @param {number} py */
  press(px, py) {
    if (!this.active) return false;
    this.#points.push([this.map.view.worldX(px), this.map.view.worldY(py)]);
    this.#update();
    return true;
  }

  #update() {
    this.answer.hidden = !this.active;
    this.answer.textContent = this.active ? sentence(this.#points, this.rotation_rad) : "";
    this.map.redraw();
  }

  /** @param {import("./scene.js").Scene} scene */
  #draw({ ctx, view, palette }) {
    const places = this.#points.map(([x, y]) => /** @type {Point} */ ([view.screenX(x), view.screenY(y)]));
    ctx.strokeStyle = ctx.fillStyle = palette.ink;
    ctx.lineWidth = 1.5;
    ctx.beginPath();
    places.forEach(([px, py], i) => (i ? ctx.lineTo(px, py) : ctx.moveTo(px, py)));
    ctx.stroke();
    for (const [px, py] of places) ctx.fillRect(px - 3, py - 3, 6, 6);
    ctx.font = `11px ${palette.font}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "bottom";
    legsOf(this.#points).forEach(({ length_m }, i) => {
      const [from, to] = [places[i], places[i + 1]];
      haloText(ctx, palette, length(length_m), (from[0] + to[0]) / 2, (from[1] + to[1]) / 2 - 4, palette.ink);
    });
  }
}
