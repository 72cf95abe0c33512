/** The status of every tag that the service knows, including tags without a pose. */

import { api, getJson } from "./connection.js";

const REQUEST_MS = 3000;
/** The response grows with the fleet, so the page requests it less often for a large fleet. */
const REQUEST_MS_PER_TAG = 5;

/** @typedef {{offset_s: number, uncertainty_s: number}} Offset */
/** @typedef {{reason: string, hint: string, hint_phrase: import("../i18n/said.js").Phrase | null, setting: Record<string, string | boolean> | null}} Care */

/**
 * @typedef {object} TagStatus as in the contract, as far as the page needs it
 * @property {string} tag
 * @property {boolean} online
 * @property {Record<string, number>} samples by kind
 * @property {Record<string, number>} rejected by reason
 * @property {number} [lag_s] how late its poses come at most, because it sends its motion in batches
 * @property {string} hint what a person can do so that more samples are used; empty when there is nothing to do
 * @property {import("../i18n/said.js").Phrase | null} hint_phrase
 * @property {string | null} unknown_anchor an anchor that the tag ranges to although the site does not have it
 * @property {Health | null} health what the tag reports about itself
 * @property {(Offset & {from_motion: Offset | null}) | null} clock_offset of motion, ahead of the ranges
 * @property {Care[]} needs_care what a person should do for the tag
 * @property {{height_m: number, name: string, group: string, colour: string | null}} settings
 */

/**
 * @typedef {object} Health as in the contract; every value may be missing
 * @property {number} age_s
 * @property {number} [battery_fraction]
 * @property {number} [battery_v]
 * @property {number} [temperature_c]
 * @property {string} [firmware]
 * @property {number} [rssi_dbm]
 * @property {number} [spool_bytes]
 * @property {number} [spool_oldest_s]
 * @property {number} [lost_messages]
 */

/** Event: "removed", when tags are no longer known to the service. */
export class Roster extends EventTarget {
  /** @type {Map<string, TagStatus>} */
  #statuses = new Map();

  /** True while the page shows the past: what the service knows now is not about that. */
  hidden = false;

  /** @param {import("./fleet.js").Fleet} fleet */
  constructor(fleet) {
    super();
    this.fleet = fleet;
  }

  /** @param {string} tag */
  of(tag) {
    return this.hidden ? null : (this.#statuses.get(tag) ?? null);
  }

  /** Return whether a person should do something for a tag. @param {string} tag */
  needsCare(tag) {
    return (this.of(tag)?.needs_care.length ?? 0) > 0;
  }

  /** Return how many tags need care. */
  get careCount() {
    let count = 0;
    for (const tag of this.#statuses.keys()) if (this.needsCare(tag)) count++;
    return count;
  }

  /** Return the height of a tag above the plane of the site in m. @param {string} tag */
  height(tag) {
    return this.of(tag)?.settings.height_m ?? 0;
  }

  /** Request the statuses now and then periodically. */
  async start() {
    await this.refresh();
    setTimeout(() => this.start(), REQUEST_MS + REQUEST_MS_PER_TAG * this.fleet.size);
  }

  /** Request the statuses now. */
  async refresh() {
    try {
      const { tags } = await getJson(api("tags"));
      if (!this.hidden) this.#update(tags);
    } catch {
      // The connection reports the failure. The next response will contain everything.
    }
  }

  /** @param {TagStatus[]} statuses */
  #update(statuses) {
    const before = this.#statuses;
    this.#statuses = new Map(statuses.map((status) => [status.tag, status]));
    const poseless = statuses.filter(({ tag }) => !this.fleet.hasPose(this.fleet.row(tag)));
    const tags = poseless.map(({ tag }) => tag);
    this.fleet.apply({ t_ns: 0, tags, online: poseless.map(({ online }) => online) }, 0);
    this.fleet.describe(this.#statuses);
    if ([...before.keys()].some((tag) => !this.#statuses.has(tag))) this.dispatchEvent(new Event("removed"));
  }
}
