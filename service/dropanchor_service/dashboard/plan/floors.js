/** The floors that the plans show, the chosen one, and which tags are on another. */

import { addressValues, writeAddress } from "../data/address.js";

/** @typedef {import("./plan_store.js").Plan} Plan */
/** @typedef {{name: string, bottom_m: number, ranges: [number, number][]}} FloorOfSite */

/** Return the floors, the highest first. Plans with the same name of a floor belong together. @param {readonly Plan[]} plans @returns {FloorOfSite[]} */
export function floorsOf(plans) {
  /** @type {Map<string, [number, number][]>} */
  const ranges = new Map();
  for (const { floor } of plans) if (floor) ranges.set(floor.name, [...(ranges.get(floor.name) ?? []), [floor.bottom_m, floor.top_m]]);
  const floors = [...ranges].map(([name, of]) => ({ name, bottom_m: Math.min(...of.map(([bottom]) => bottom)), ranges: of }));
  return floors.sort((a, b) => b.bottom_m - a.bottom_m);
}

/** @param {FloorOfSite} floor @param {number} height_m */
const reaches = ({ ranges }, height_m) => ranges.some(([bottom, top]) => height_m >= bottom && height_m < top);

const BELIEVED = 0.9;

/** Return whether a tag is not known to be on the chosen floor. A tag without any floor may be on it.
 * @param {FloorOfSite | null} chosen @param {string | null | undefined} floor of the pose @param {number} probability of that floor */
export const isElsewhere = (chosen, floor, probability) => !!chosen && !!floor && !(floor === chosen.name && probability > BELIEVED);

/** Event: "change". */
export class Floors extends EventTarget {
  /** @type {FloorOfSite[]} */
  all = [];
  /** At first the one at the height of the anchor, or the lowest; null: there is at most one. @type {FloorOfSite | null} */
  chosen = null;

  /** @param {HTMLSelectElement} select */
  constructor(select) {
    super();
    this.select = select;
    select.addEventListener("change", () => this.choose(select.value));
    addEventListener("hashchange", () => this.#changed());
  }

  /** @param {readonly Plan[]} plans */
  setPlans(plans) {
    this.all = floorsOf(plans);
    this.select.replaceChildren(...this.all.map(({ name }) => new Option(name)));
    this.select.hidden = this.all.length < 2;
    this.#changed();
  }

  /** @param {string} name */
  choose(name) {
    writeAddress({ floor: name });
    this.#changed();
  }

  /** Return whether a plan is shown: it belongs to the chosen floor, or to all. @param {Plan} plan */
  shows({ floor }) {
    return floor === null || this.chosen === null || floor.name === this.chosen.name;
  }

  #changed() {
    const { all } = this;
    const wanted = addressValues().get("floor");
    const found = all.find(({ name }) => name === wanted) ?? all.find((floor) => reaches(floor, 0)) ?? all.at(-1);
    this.chosen = all.length < 2 ? null : (found ?? null);
    this.select.value = this.chosen?.name ?? "";
    this.dispatchEvent(new Event("change"));
  }
}
