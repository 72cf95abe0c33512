/** A bar that a person drags, or moves with arrow keys, to give a part of the page more room. The browser remembers it. */

import { chosen, remember } from "../data/display.js";

const STEP = 5;

/**
 * @typedef {object} Share what part of the page the bar sizes
 * @property {string} name under which the browser remembers it
 * @property {string} variable of the style sheet, which has the usual size
 * @property {() => HTMLElement} part after the bar
 * @property {HTMLElement} whole
 * @property {number} least percent of the whole
 * @property {number} most
 */

/** Event: "change". */
export class Splitter extends EventTarget {
  /** Where a drag began. @type {{at: number, value: number} | null} */
  #grab = null;

  /** @param {HTMLElement} bar with `aria-orientation` @param {Share} share */
  constructor(bar, share) {
    super();
    this.bar = bar;
    this.share = share;
    bar.setAttribute("aria-valuemin", String(share.least));
    bar.setAttribute("aria-valuemax", String(share.most));
    bar.addEventListener("pointerdown", (event) => this.#take(event));
    bar.addEventListener("pointermove", (event) => this.#drag(event));
    for (const name of ["pointerup", "pointercancel"]) bar.addEventListener(name, () => (this.#grab = null));
    bar.addEventListener("dblclick", () => this.move(null));
    bar.addEventListener("keydown", (event) => this.#key(event));
    bar.addEventListener("focus", () => this.#tell());
    const kept = Number(chosen(share.name, null) ?? "");
    if (kept > 0) this.#show(kept);
    this.#tell();
  }

  /** Percent of the whole that the part takes now. */
  get value() {
    const { part, whole } = this.share;
    const [size, all] = this.#isUpright ? [part().offsetWidth, whole.offsetWidth] : [part().offsetHeight, whole.offsetHeight];
    return all > 0 ? Math.round((100 * size) / all) : this.share.least;
  }

  /** @param {number | null} percent null: as usual */
  move(percent) {
    this.#show(percent);
    remember({ [this.share.name]: document.body.style.getPropertyValue(this.share.variable).replace("%", "") });
    this.#tell();
  }

  get #isUpright() {
    return this.bar.getAttribute("aria-orientation") === "vertical";
  }

  /** @param {PointerEvent} event */
  #take(event) {
    this.bar.setPointerCapture(event.pointerId);
    this.#grab = { at: this.#isUpright ? event.clientX : event.clientY, value: this.value };
  }

  /** @param {PointerEvent} event */
  #drag({ clientX, clientY }) {
    if (!this.#grab) return;
    const { whole } = this.share;
    const moved = this.#isUpright ? (this.#grab.at - clientX) / whole.offsetWidth : (this.#grab.at - clientY) / whole.offsetHeight;
    this.move(this.#grab.value + 100 * moved);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const { least, most } = this.share;
    const [more, less] = this.#isUpright ? ["ArrowLeft", "ArrowRight"] : ["ArrowUp", "ArrowDown"];
    /** @type {Record<string, number | null>} */
    const sizes = { [more]: this.value + STEP, [less]: this.value - STEP, Home: least, End: most, Enter: null };
    if (!(event.key in sizes)) return;
    event.preventDefault();
    this.move(sizes[event.key]);
  }

  /** @param {number | null} percent */
  #show(percent) {
    const { variable, least, most } = this.share;
    if (percent === null) document.body.style.removeProperty(variable);
    else document.body.style.setProperty(variable, `${Math.round(Math.min(most, Math.max(least, percent)))}%`);
  }

  #tell() {
    this.bar.setAttribute("aria-valuenow", String(Math.min(this.share.most, Math.max(this.share.least, this.value))));
    this.dispatchEvent(new Event("change"));
  }
}
