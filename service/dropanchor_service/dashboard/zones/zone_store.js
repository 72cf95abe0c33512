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

  get paths() {
    return ["zones", "zone-occupancy"];
  }

  /** @param {any[]} answers */
  take([zones, occupancy]) {
    if (zones) this.zones = zones.zones;
    if (occupancy) this.inside = new Map(occupancy.zones.map((/** @type {{zone: string, tags: number}} */ { zone, tags }) => [zone, tags]));
  }
}
