/** *Back* of the browser closes what is open, one after the other, before it leaves the page.
 *
 * While anything is open, the history has one entry more. It has the same address, so that no link changes. */

import { keepAddress } from "../data/address.js";
import { isKiosk } from "./kiosk.js";

/** What *Back* closes first. @type {readonly import("./one_panel.js").PanelName[]} */
const ORDER = [
  "trail", "keys", "display", "sharing", "figures", "measure", "start", "zone", "rule", "destination", "plans", "anchors", "several", "tag", "heat", "past",
];

export class Back {
  #isAbove = false;
  /** Whether this page itself goes back, because nothing is open. What is opened meanwhile stays. */
  #isLeaving = false;
  /** The address that the browser went back to, and that is not to be read. */
  #left = "";

  /** @param {import("./one_panel.js").Panels} panels */
  constructor(panels) {
    this.panels = panels;
    addEventListener("popstate", ({ state }) => this.#went(state));
    addEventListener("hashchange", (event) => event.newURL === this.#left && event.stopImmediatePropagation(), { capture: true });
  }

  /** Add the entry once something is open, and take it away when nothing is. */
  update() {
    const isOpen = this.#open !== undefined;
    if (isKiosk || this.#isLeaving || isOpen === this.#isAbove) return; // nobody opens anything on a wall
    this.#isAbove = isOpen;
    this.#isLeaving = !isOpen;
    if (!isOpen) return history.back();
    history.replaceState({ is: "below" }, "");
    history.pushState({ is: "above" }, "");
  }

  /** What *Back* closes now. */
  get #open() {
    const { states } = this.panels;
    return ORDER.find((name) => states[name]);
  }

  /** @param {{is?: string} | null} state of the entry that the browser went to */
  #went(state) {
    const isOwn = this.#isLeaving;
    [this.#isLeaving, this.#isAbove] = [false, state?.is === "above"];
    this.#left = state?.is === "below" ? location.href : "";
    if (this.#left === "") return;
    keepAddress();
    if (this.#open && !isOwn) this.panels.close(this.#open);
  }
}
