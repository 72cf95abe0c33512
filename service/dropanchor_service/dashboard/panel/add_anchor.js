/** Add an anchor that the selected tag hears and the site lacks: at the centre of the map, or at coordinates. */

import { sendJson } from "../data/access.js";
import { api } from "../data/connection.js";

const CENTIMETRES = 100;

export class AddAnchor {
  /** The anchor that the form adds. */
  #anchor = "";

  /** @param {HTMLElement} panel @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice
   * @param {() => [number, number]} centre returns x and y of the centre of the map */
  constructor(panel, roster, choice, centre) {
    this.roster = roster;
    this.choice = choice;
    this.centre = centre;
    this.offer = /** @type {HTMLButtonElement} */ (panel.querySelector('[data-part="add-anchor"]'));
    this.form = /** @type {HTMLFormElement} */ (panel.querySelector('[data-part="new-anchor"]'));
    this.answer = /** @type {HTMLElement} */ (panel.querySelector('[data-part="anchor-answer"]'));
    this.offer.addEventListener("click", () => this.#open());
    this.form.addEventListener("submit", (event) => this.#add(event));
    this.form.addEventListener("reset", () => this.#close());
    choice.addEventListener("change", () => this.#close());
  }

  update() {
    const { selected } = this.choice;
    const missing = selected === null ? null : (this.roster.of(selected)?.unknown_anchor ?? null);
    this.offer.hidden = missing === null || !this.form.hidden;
    if (missing !== null && this.offer.dataset.anchor !== missing) {
      this.offer.dataset.anchor = missing;
      this.offer.textContent = `Add anchor ${missing}`;
    }
  }

  #open() {
    this.#anchor = this.offer.dataset.anchor ?? "";
    const [x, y] = this.centre();
    for (const [name, value] of Object.entries({ x, y, z: 0 })) {
      this.#field(name).value = String(Math.round(value * CENTIMETRES) / CENTIMETRES);
    }
    this.form.hidden = false;
    this.answer.textContent = "";
    this.update();
    this.#field("x").select();
  }

  #close() {
    this.form.hidden = true;
    this.answer.textContent = "";
    this.update();
  }

  /** @param {string} name */
  #field(name) {
    return /** @type {HTMLInputElement} */ (this.form.elements.namedItem(name));
  }

  /** @param {Event} event */
  async #add(event) {
    event.preventDefault();
    const id = this.#anchor;
    const [x, y, z] = ["x", "y", "z"].map((name) => this.#field(name).valueAsNumber);
    try {
      await sendJson(api(`anchors/${encodeURIComponent(id)}`), "PUT", { id, x, y, z });
      this.form.hidden = true;
      this.answer.textContent = `Anchor ${id} is part of the site now.`;
      await this.roster.refresh();
    } catch (error) {
      this.answer.textContent = error instanceof Error ? error.message : String(error);
    }
    this.update();
  }
}
