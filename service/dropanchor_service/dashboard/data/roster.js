/** All tags that the service has heard, with what it counted: also those that have no pose yet. */

import { api, getJson } from "./connection.js";

const ASK_MS = 3000;
/** The answer grows with the fleet, so a large fleet is asked for less often. */
const ASK_MS_PER_TAG = 5;

/**
 * @typedef {object} TagStatus as in the contract, as far as the page needs it
 * @property {string} tag
 * @property {boolean} online
 * @property {Record<string, number>} samples by kind
 * @property {Record<string, number>} rejected by reason
 * @property {string} hint what a person can do so that more is used; empty when nothing is needed
 * @property {{height_m: number}} settings
 */

export class Roster {
  /** @type {Map<string, TagStatus>} */
  #statuses = new Map();

  /** @param {import("./fleet.js").Fleet} fleet */
  constructor(fleet) {
    this.fleet = fleet;
  }

  /** @param {string} tag */
  of(tag) {
    return this.#statuses.get(tag) ?? null;
  }

  /** Height of a tag above the plane of the site, m. @param {string} tag */
  height(tag) {
    return this.of(tag)?.settings.height_m ?? 0;
  }

  /** Ask now and again and again. */
  async start() {
    try {
      this.#take((await getJson(api("tags"))).tags);
    } catch {
      // The connection says so, and the next answer will bring it all.
    }
    setTimeout(() => this.start(), ASK_MS + ASK_MS_PER_TAG * this.fleet.size);
  }

  /** @param {TagStatus[]} statuses */
  #take(statuses) {
    this.#statuses = new Map(statuses.map((status) => [status.tag, status]));
    const poseless = statuses.filter(({ tag }) => !this.fleet.hasPose(this.fleet.row(tag)));
    const tags = poseless.map(({ tag }) => tag);
    this.fleet.apply({ t_ns: 0, tags, online: poseless.map(({ online }) => online) }, 0);
  }
}
