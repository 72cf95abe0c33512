/** Connect floor plans and floors: what the service sends, the map, the panel and the choice of a floor. */

import { giveTo } from "../setup/gestures.js";
import { drawEditedPlan, drawPlan } from "./draw_plans.js";
import { Floors, isElsewhere } from "./floors.js";
import { PlanEditor } from "./plan_editor.js";
import { PlanImages } from "./plan_images.js";
import { PlanPanel } from "./plan_panel.js";
import { PlanStore } from "./plan_store.js";
import { t } from "../i18n/language.js";
import { byId } from "../page/parts.js";

export class Plans {
  store = new PlanStore();
  images = new PlanImages();

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/connection.js").Connection} connection
   * @param {import("../data/changes.js").Changes} changes @param {import("../page/one_panel.js").Panels} panels */
  constructor(map, connection, changes, panels) {
    this.map = map;
    this.floors = new Floors(byId("floor"));
    this.editor = new PlanEditor(map, changes, this.store);
    new PlanPanel(byId("plans"), byId("edit-plans"), byId("confirm"), this.editor, changes, panels);
    this.#drawOn(map);
    const { number, value } = map.fleet;
    map.isElsewhere = (row) => isElsewhere(this.floors.chosen, value.floor[row], number.floor_probability[row]);
    giveTo(map, [this.editor]);
    for (const source of [this.images, this.floors]) source.addEventListener("change", () => map.redraw());
    this.store.addEventListener("change", () => this.#takePlans());
    connection.addEventListener("site", (event) => (this.editor.georeference = /** @type {CustomEvent} */ (event).detail.georeference));
    connection.addEventListener("settings", () => this.store.refresh());
    connection.addEventListener("status", () => connection.status === "live" && this.store.refresh());
  }

  /** @param {import("../map/map.js").LiveMap} map */
  #drawOn(map) {
    map.underlays.unshift(({ ctx, view }) => {
      const isDark = document.documentElement.dataset.theme === "dark";
      for (const plan of this.#shown()) drawPlan(ctx, view, plan, this.images.of(plan.image, isDark && plan.dark_inverted));
    });
    map.overlays.push(({ ctx, view, palette }) => {
      if (this.editor.draft) drawEditedPlan(ctx, view, palette, this.editor.draft);
    });
  }

  /** Return the plans of the chosen floor, and the one that is being edited as it is now. */
  #shown() {
    const { draft } = this.editor;
    return this.store.plans.map((plan) => (plan.id === draft?.id ? draft : plan)).filter((plan) => plan === draft || (this.map.layers.isShown("plans") && this.floors.shows(plan)));
  }

  #takePlans() {
    this.images.keep(this.store.plans.map(({ image }) => image));
    this.floors.setPlans(this.store.plans);
    this.map.redraw();
  }
}
