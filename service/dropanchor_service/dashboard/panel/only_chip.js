/** The number of tags or alarms of a kind, as a chip that shows these tags alone. It is there while there are any. */

import { count } from "../data/format.js";
import { write } from "../page/parts.js";

export class OnlyChip {
  /** @param {HTMLElement} button @param {string} kind as in the choice @param {() => number} counted
   * @param {import("../page/choice.js").Choice} choice */
  constructor(button, kind, counted, choice) {
    this.button = button;
    this.kind = kind;
    this.counted = counted;
    this.choice = choice;
    button.addEventListener("click", () => (choice.only = choice.only === kind ? "" : kind));
    choice.addEventListener("change", () => this.update());
  }

  update() {
    const [counted, isOnly] = [this.counted(), this.choice.only === this.kind];
    this.button.hidden = counted === 0 && !isOnly;
    this.button.setAttribute("aria-pressed", String(isOnly));
    write(/** @type {HTMLElement} */ (this.button.querySelector(".count")), count(counted));
  }
}
