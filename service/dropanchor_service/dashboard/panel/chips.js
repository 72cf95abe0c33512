/** The states as a legend that counts and filters. */

import { countStates } from "../page/choice.js";
import { BEST_FIRST, STATES } from "../data/states.js";
import { symbol } from "../map/symbols.js";

export class StateChips {
  /** @type {{button: HTMLButtonElement, count: HTMLElement}[]} */
  #chips;

  /** @param {HTMLElement} box @param {import("../data/fleet.js").Fleet} fleet @param {import("../page/choice.js").Choice} choice */
  constructor(box, fleet, choice) {
    this.fleet = fleet;
    this.choice = choice;
    this.#chips = STATES.map((state, number) => this.#build(state, number));
    box.append(...BEST_FIRST.map((number) => this.#chips[number].button));
    choice.addEventListener("change", () => this.update());
    this.update();
  }

  update() {
    const counts = countStates(this.fleet);
    this.#chips.forEach(({ button, count }, state) => {
      const shown = !this.choice.hiddenStates.has(state);
      button.setAttribute("aria-pressed", String(shown));
      button.classList.toggle("none", counts[state] === 0);
      const value = counts[state].toLocaleString("en");
      if (count.textContent !== value) count.textContent = value;
    });
  }

  /** @param {import("../data/states.js").StateStyle} state @param {number} number */
  #build(state, number) {
    const button = document.createElement("button");
    const count = document.createElement("span");
    button.type = "button";
    button.className = "chip";
    button.dataset.state = state.name;
    button.title = `${state.meaning} Press to hide or show.`;
    count.className = "count";
    button.append(symbol(state.name).svg, state.label, count);
    button.addEventListener("click", () => this.choice.toggleState(number));
    return { button, count };
  }
}
