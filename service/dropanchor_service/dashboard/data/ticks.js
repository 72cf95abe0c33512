/** A list of things that a person wants to see, with a tick for each. The browser remembers the choice. */

import { chosen, remember } from "./display.js";
import { t } from "../i18n/language.js";

/** What the map draws, besides tags and anchors. Those of selected tags are always there. */
export const LAYERS = ["plans", "zones", "heat", "rings", "ellipses", "trails", "names"];

/** Event: "change". */
export class Ticks extends EventTarget {
  /** @type {Set<string>} */
  #shown;

  /** @param {string} name of the choice @param {readonly string[]} all @param {readonly string[]} [askedFor] those that nobody sees unasked */
  constructor(name, all, askedFor = []) {
    super();
    this.name = name;
    this.all = all;
    this.#shown = new Set((chosen(name, null) ?? all.filter((one) => !askedFor.includes(one)).join()).split(","));
  }

  /** @param {string} one */
  isShown(one) {
    return this.#shown.has(one);
  }

  /** Offer them all. @param {HTMLElement} box */
  offer(box) {
    box.append(...this.all.map((one) => {
      const label = Object.assign(document.createElement("label"), { className: "check" });
      const tick = Object.assign(document.createElement("input"), { type: "checkbox", checked: this.isShown(one) });
      tick.addEventListener("change", () => this.#show(one, tick.checked));
      label.append(tick, ` ${t(`${this.name}.${one}`)}`);
      return label;
    }));
  }

  /** @param {string} one @param {boolean} on */
  #show(one, on) {
    if (on) this.#shown.add(one);
    else this.#shown.delete(one);
    remember({ [this.name]: [...this.#shown].join() });
    this.dispatchEvent(new Event("change"));
  }
}
