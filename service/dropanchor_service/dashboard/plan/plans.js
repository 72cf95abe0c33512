/** Connect floor plans and floors: what the service sends, the map, the panel and the choice of a floor. */

import { giveTo } from "../setup/gestures.js";
import { drawEditedPlan, drawPlan } from "./draw_plans.js";
import { Floors, isElsewhere } from "./floors.js";
import { PlanEditor } from "./plan_editor.js";
import { PlanImages } from "./plan_images.js";
import { PlanPanel } from "./plan_panel.js";
import { PlanStore } from "./plan_store.js";
import { t } from "../i18n/language.js";

/** @template {HTMLElement} T @param {string} id @returns {T} */
const byId = (id) => /** @type {T} */ (document.getElementById(id));

export class Plans {
  store = new PlanStore();
  images = new PlanImages();

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/connection.js").Connection} connection
   * @param {import("../setup/setup.js").Setup} setup */
  constructor(map, roster, choice, connection, setup) {
    this.map = map;
    this.floors = new Floors(byId("floor"));
    this.editor = new PlanEditor(map, setup.changes, this.store);
    new PlanPanel(byId("plans"), byId("edit-plans"), byId("confirm"), this.editor, setup.changes);
    this.#drawOn(map);
    map.isElsewhere = (row) => this.floors.chosen !== null && isElsewhere(this.floors.all, this.floors.chosen, roster.height(map.fleet.names[row]));
    giveTo(map, [this.editor]);
    for (const source of [this.images, this.floors]) source.addEventListener("change", () => map.redraw());
    this.images.addEventListener("change", () => this.#sayFaults());
    this.store.addEventListener("change", () => this.#takePlans());
    this.editor.addEventListener("change", () => this.#keepApart(setup, choice));
    for (const other of [choice, setup.anchors]) other.addEventListener("change", () => this.#giveWay(setup, choice));
    byId("history").addEventListener("click", () => this.editor.close());
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
    return this.store.plans.map((plan) => (plan.id === draft?.id ? draft : plan)).filter((plan) => plan === draft || this.floors.shows(plan));
  }

  #takePlans() {
    this.images.keep(this.store.plans.map(({ image }) => image));
    this.floors.setPlans(this.store.plans);
    this.map.redraw();
    this.#sayFaults();
  }

  /** Say which plans are not shown, or not in full, because a browser takes too long for them. */
  #sayFaults() {
    const lines = /** @type {const} */ ([["slow", "plans.slow"], ["coarse", "plans.coarse"]]).map(([fault, message]) => {
      const plans = this.store.plans.filter(({ image }) => this.images.faultOf(image) === fault);
      return plans.length === 0 ? "" : t(message, { plans: plans.map(({ id, name }) => name || id).join(", ") });
    });
    const notice = byId("plan-faults");
    notice.textContent = lines.filter(Boolean).join(" ");
    notice.hidden = notice.textContent === "";
  }

  /** While plans are edited, no tag is selected and no anchor is edited.
   * @param {import("../setup/setup.js").Setup} setup @param {import("../page/choice.js").Choice} choice */
  #keepApart(setup, choice) {
    if (!this.editor.isOpen) return;
    if (setup.anchors.isOpen) setup.anchors.close();
    choice.select(null);
  }

  /** @param {import("../setup/setup.js").Setup} setup @param {import("../page/choice.js").Choice} choice */
  #giveWay(setup, choice) {
    if (this.editor.isOpen && (choice.selected !== null || setup.anchors.isOpen)) this.editor.close();
  }
}
