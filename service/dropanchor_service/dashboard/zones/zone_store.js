/** The zones of the service, and how many tags are in each. */

import { request, sendChange } from "../data/access.js";
import { api, getJson } from "../data/connection.js";

/** @typedef {{type: "polygon", points: [number, number][]} | {type: "circle", x: number, y: number, radius_m: number}} Shape */
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
 * @property {number} delay_s
 * @property {string[]} tags
 * @property {string[]} groups
 */

const PERIOD_MS = 3000;

/** @param {string} id */
const pathOf = (id) => api(`zones/${encodeURIComponent(id)}`);

/** Event: "change". */
export class ZoneStore extends EventTarget {
  /** @type {Zone[]} */
  zones = [];
  /** Tags inside, by zone. @type {Map<string, number>} */
  inside = new Map();
  /** @type {"none" | "read" | "write" | "admin"} */
  scope = "none";
  #timer = 0;

  get mayWrite() {
    return this.scope === "write" || this.scope === "admin";
  }

  get mayDelete() {
    return this.scope === "admin";
  }

  /** Request everything now and every few seconds, until `stop`. */
  async start() {
    this.stop();
    this.scope = await getJson(api("access")).then(({ scope }) => scope, () => "none");
    await this.#repeat();
  }

  stop() {
    clearTimeout(this.#timer);
    this.#timer = 0;
  }

  async #repeat() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#repeat(), PERIOD_MS);
    await this.refresh();
  }

  /** Request everything now. A failure leaves what was known: the page's connection says what is wrong. */
  async refresh() {
    const paths = ["zones", "zone-occupancy"];
    const [zones, occupancy] = await Promise.all(paths.map((path) => getJson(api(path)).catch(() => null)));
    if (zones) this.zones = zones.zones;
    if (occupancy) this.inside = new Map(occupancy.zones.map((/** @type {{zone: string, tags: number}} */ { zone, tags }) => [zone, tags]));
    this.dispatchEvent(new Event("change"));
  }

  /** @param {string} id @returns {Promise<{zone: Zone, etag: string}>} */
  async read(id) {
    const response = await request(pathOf(id), {});
    return { zone: await response.json(), etag: response.headers.get("etag") ?? "" };
  }

  /** Save a zone. Throws as sendChange does. @param {Zone} zone @param {string | null} etag of the present one; null: it is new */
  async save(zone, etag) {
    await sendChange(pathOf(zone.id), "PUT", zone, etag === null ? { "if-none-match": "*" } : { "if-match": etag });
    await this.refresh();
  }

  /** Delete a zone. Throws as sendChange does. @param {string} id @param {string} etag */
  async remove(id, etag) {
    await sendChange(pathOf(id), "DELETE", null, { "if-match": etag });
    await this.refresh();
  }
}
