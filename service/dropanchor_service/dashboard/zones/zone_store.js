/** The zones of the service, and how many tags are in each. */

import { Items } from "../data/items.js";
import { Refreshed } from "../data/refreshed.js";

/** @typedef {{type: "polygon", points: [number, number][]} | {type: "circle", x: number, y: number, radius_m: number}} Shape */
/** @typedef {"event" | "warning" | "alarm"} Severity */
/**
 * @typedef {object} Zone as in the interface
 * @property {string} id
 * @property {string} name
 * @property {string} colour
 * @property {Shape} shape
 * @property {boolean} enter
 * @property {boolean} exit
 * @property {number | null} dwell_s
 * @property {number | null} speed_mps
 * @property {Severity} enter_severity
 * @property {Severity} dwell_severity
 * @property {Severity} speed_severity
 * @property {number | null} z_min_m
 * @property {number | null} z_max_m
 * @property {number} delay_s
 * @property {string[]} tags
 * @property {string[]} groups
 */

/** Event: "change". */
export class ZoneStore extends Refreshed {
  items = new Items("zones", (answer) => answer);
  /** @type {Zone[]} */
  zones = [];
  /** Tags inside, by zone. @type {Map<string, number>} */
  inside = new Map();

  /** Return whether anybody wants to know which tags are inside. */
  wantsNames = () => false;
  /** The names and ids of the zones of each tag. @type {Map<string, string[]>} */
  #zonesOf = new Map();

  get paths() {
    return ["zones", this.wantsNames() ? "zone-occupancy?names=true" : "zone-occupancy"];
  }

  /** Return the names of the zones in which a tag is, once somebody wanted to know. @param {string} tag @returns {readonly string[]} */
  zonesOf(tag) {
    return this.#zonesOf.get(tag) ?? [];
  }

  /** @param {any[]} answers */
  take([zones, occupancy]) {
    if (zones) this.zones = zones.zones;
    if (occupancy) this.#take(occupancy.zones);
    if (occupancy) this.inside = new Map(occupancy.zones.map((/** @type {{zone: string, tags: number}} */ { zone, tags }) => [zone, tags]));
  }

  /** @param {{zone: string, inside: {tag: string}[] | null}[]} occupied */
  #take(occupied) {
    const names = new Map(this.zones.map(({ id, name }) => [id, name || id]));
    this.#zonesOf = new Map();
    for (const { zone, inside } of occupied) {
      for (const { tag } of inside ?? []) this.#zonesOf.set(tag, [...this.zonesOf(tag), names.get(zone) ?? zone]);
    }
  }
}
