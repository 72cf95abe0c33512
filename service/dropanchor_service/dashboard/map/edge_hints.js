/** Say at the edges of the map how many tags lie beyond them. A click shows those tags, too. */

import { count, tagCount } from "../data/format.js";
import { t } from "../i18n/language.js";
import { tagsOutside } from "./outside.js";

/** @typedef {import("./outside.js").Side} Side */

const SIDES = /** @type {const} */ (["left", "right", "up", "down"]);

export class EdgeHints {
  /** @type {Map<Side, import("./outside.js").Group>} */
  #groups = new Map();
  /** @type {Map<Side, HTMLButtonElement>} */
  #buttons = new Map();

  /** @param {HTMLElement} box @param {import("./map.js").LiveMap} map */
  constructor(box, map) {
    this.map = map;
    for (const side of SIDES) this.#buttons.set(side, this.#build(side));
    box.append(...this.#buttons.values());
  }

  /** Count the tags again. This is not done for each drawing, since a few times a second suffice. */
  update() {
    const { map } = this;
    this.#groups = map.autoFit ? new Map() : tagsOutside(map.fleet, map.view.bounds(), (row) => map.isShown(row));
    for (const [side, button] of this.#buttons) this.#show(button, side, this.#groups.get(side)?.count ?? 0);
    map.hints = [...this.#buttons.values()].filter((button) => !button.hidden).map(boxOf);
  }

  /** @param {HTMLButtonElement} button @param {Side} side @param {number} tags */
  #show(button, side, tags) {
    if (tags === 0 && button === document.activeElement) this.map.canvas.focus();
    button.hidden = tags === 0;
    button.style.setProperty("--covered", `${this.map.view.covered}px`);
    const text = count(tags);
    if (button.textContent === text) return;
    button.textContent = text;
    button.title = t(`map.outside.${side}`, { tags: tagCount(tags) });
    button.setAttribute("aria-label", button.title);
  }

  /** @param {Side} side */
  #build(side) {
    const button = Object.assign(document.createElement("button"), { type: "button", hidden: true });
    button.dataset.side = side;
    button.addEventListener("click", () => {
      const group = this.#groups.get(side);
      if (group) this.map.showToo(group.bounds);
    });
    return button;
  }
}

/** Return the box of a button on the map. @param {HTMLElement} button @returns {number[]} */
function boxOf({ offsetLeft: left, offsetTop: top, offsetWidth, offsetHeight }) {
  return [left, top, left + offsetWidth, top + offsetHeight];
}
