/** Say where a tag is and where it is heading: click the place, drag towards the heading, or type both. */

import { degreesOf, headingOf } from "../data/compass.js";
import { toCentimetre } from "./gestures.js";

const DRAG_PX = 10;

/** @typedef {{x: number, y: number, heading_rad: number | null}} Start */

/** Event: "change". */
export class StartEditor extends EventTarget {
  /** Direction of the x axis, counter-clockwise from east. */
  rotation_rad = 0;
  /** The pose on the map; null: the tool is not in use. @type {Start | null} */
  draft = null;
  /** Whether a person has changed the pose. */
  isUnsaved = false;
  #pressed = { px: 0, py: 0 };

  /** @param {Start} draft */
  begin(draft) {
    this.#set({ ...draft, x: toCentimetre(draft.x), y: toCentimetre(draft.y) });
    this.isUnsaved = false;
  }

  /** The heading in degrees clockwise from north; null: unknown. */
  get degrees() {
    const heading = this.draft?.heading_rad ?? null;
    return heading === null ? null : degreesOf(heading, this.rotation_rad);
  }

  /** @param {number} x @param {number} y @param {number | null} degrees */
  type(x, y, degrees) {
    if (this.draft) this.#set({ x, y, heading_rad: degrees === null ? null : headingOf(degrees, this.rotation_rad) });
  }

  cancel() {
    const wasInUse = this.draft !== null;
    if (wasInUse) this.#set(null);
    return wasInUse;
  }

  /** @param {import("./gestures.js").Spot} at */
  press({ x, y, px, py }) {
    if (!this.draft) return false;
    this.#pressed = { px, py };
    this.#set({ ...this.draft, x: toCentimetre(x), y: toCentimetre(y) });
    return true;
  }

  /** @param {import("./gestures.js").Spot} at */
  drag({ x, y, px, py }) {
    if (!this.draft || Math.hypot(px - this.#pressed.px, py - this.#pressed.py) < DRAG_PX) return;
    this.#set({ ...this.draft, heading_rad: Math.atan2(y - this.draft.y, x - this.draft.x) });
  }

  drop() {}

  key() {
    return false;
  }

  /** @param {Start | null} draft */
  #set(draft) {
    this.draft = draft;
    this.isUnsaved = draft !== null;
    this.dispatchEvent(new Event("change"));
  }
}
