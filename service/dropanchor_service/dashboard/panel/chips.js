/** The states as a legend that counts and filters. Without a connection, one chip says that all poses are out of date. */

import { countStates } from "../page/choice.js";
import { BEST_FIRST, OUT_OF_DATE, STATES } from "../data/states.js";
import { symbol } from "../map/symbols.js";
import { count as countText, t } from "../i18n/language.js";

export class StateChips {
  /** @type {{button: HTMLButtonElement, count: HTMLElement}[]} */
  #chips;
  #outdated = chip(document.createElement("span"), OUT_OF_DATE);

  /** @param {HTMLElement} box @param {import("../data/fleet.js").Fleet} fleet @param {import("../page/choice.js").Choice} choice */
  constructor(box, fleet, choice) {
    this.fleet = fleet;
    this.choice = choice;
    this.#chips = STATES.map((state, number) => this.#build(state, number));
    box.append(...[...BEST_FIRST].reverse().map((number) => this.#chips[number].button), this.#outdated.element);
    choice.addEventListener("change", () => this.update());
    this.update();
  }

  update() {
    const counts = countStates(this.fleet);
    this.#outdated.element.hidden = this.fleet.current;
    write(this.#outdated.count, this.fleet.size);
    this.#chips.forEach(({ button, count }, state) => {
      const isShown = !this.choice.hiddenStates.has(state);
      button.hidden = !this.fleet.current;
      button.setAttribute("aria-pressed", String(isShown));
      button.classList.toggle("none", counts[state] === 0);
      write(count, counts[state]);
    });
  }

  /** @param {import("../data/states.js").StateStyle} state @param {number} number */
  #build(state, number) {
    const button = document.createElement("button");
    const { count } = chip(button, state);
    button.type = "button";
    button.title = t("state.choose", { meaning: state.meaning });
    button.addEventListener("click", () => this.choice.chooseState(number));
    return { button, count };
  }
}

/** @param {HTMLElement} element @param {import("../data/states.js").StateStyle} state */
function chip(element, state) {
  const count = document.createElement("span");
  element.className = "chip";
  element.dataset.state = state.name;
  element.title = state.meaning;
  count.className = "count";
  element.append(symbol(state.name).svg, state.label, count);
  return { element, count };
}

/** @param {HTMLElement} element @param {number} count */
function write(element, count) {
  const text = countText(count);
  if (element.textContent !== text) element.textContent = text;
}
