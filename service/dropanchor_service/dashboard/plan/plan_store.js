/** The floor plans of the service, and uploads. */

import { upload } from "../data/access.js";
import { api, getJson } from "../data/connection.js";

/** @typedef {{id: string, media_type: string, width_px: number, height_px: number}} PlanImage */
/** @typedef {{name: string, bottom_m: number, top_m: number}} Floor */
/**
 * @typedef {object} Plan as in the interface
 * @property {string} id
 * @property {string} name
 * @property {PlanImage} image
 * @property {import("./transform.js").Placement} placement
 * @property {number} opacity
 * @property {boolean} dark_inverted
 * @property {Floor | null} floor
 * @property {import("./transform.js").PlacedPoint[]} control_points
 */
/** @typedef {{image: PlanImage, pages: number, placement: import("./transform.js").Placement | null, note: string, note_phrase: import("../i18n/said.js").Phrase | null}} Uploaded */

/** Event: "change". */
export class PlanStore extends EventTarget {
  /** @type {readonly Plan[]} */
  plans = [];
  #shown = "[]";

  /** @param {string} id */
  find(id) {
    return this.plans.find((plan) => plan.id === id) ?? null;
  }

  /** Request the plans now. A failure leaves what was known: the page's connection says what is wrong. */
  async refresh() {
    const answer = await getJson(api("plans")).catch(() => null);
    const shown = JSON.stringify(answer?.plans);
    if (!answer || shown === this.#shown) return;
    this.#shown = shown;
    this.plans = answer.plans;
    this.dispatchEvent(new Event("change"));
  }

  /** Upload a file. Throws Error with the sentence of the service when that refuses it.
   * @param {File} file @param {Record<string, string>} query @returns {Promise<Uploaded>} */
  async upload(file, query) {
    return upload(api(`plan-images?${new URLSearchParams(query)}`), file);
  }
}

/** @param {string} id */
export const pathOf = (id) => `plans/${encodeURIComponent(id)}`;
