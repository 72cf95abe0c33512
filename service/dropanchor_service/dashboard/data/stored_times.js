/** When poses are stored: in the whole history, and in the period that is shown. */

import { api, getJson } from "./connection.js";
import { isLimited } from "./shared.js";
import { nanoseconds } from "./track_reader.js";

/** @typedef {import("./periods.js").Period} Period */

export class StoredTimes extends EventTarget {
  /** From the first to the last pose; null: there is none, or that is not known. @type {Period | null} */
  whole = null;
  /** Times with poses in the period that is shown, in order; null: not known. @type {Period[] | null} */
  stretches = null;
  #requests = 0;

  /** Ask for the first and the last pose. Return whether the service keeps a history at all; null: it does not answer. */
  async loadWhole() {
    const history = await getJson(api("history")).catch(() => null);
    this.whole = history?.to_ns ? { from_ms: history.from_ns / 1e6, to_ms: history.to_ns / 1e6 } : null;
    return history === null ? null : history.enabled === true;
  }

  /** Ask when there are poses in the period that is shown. @param {number} from_ms @param {number} to_ms */
  async load(from_ms, to_ms) {
    const request = ++this.#requests;
    this.stretches = null;
    const stretches = await this.within(from_ms, to_ms);
    if (request !== this.#requests) return;
    this.stretches = stretches;
    this.dispatchEvent(new Event("change"));
  }

  /** Return the times with poses in a period; null where the service does not say. A link to some tags may not see when others were there.
   * @param {number} from_ms @param {number} to_ms @returns {Promise<Period[] | null>} */
  async within(from_ms, to_ms) {
    if (isLimited) return null;
    const url = api("history/coverage");
    url.search = new URLSearchParams({ from: nanoseconds(from_ms), to: nanoseconds(to_ms) }).toString();
    const found = await getJson(url).catch(() => null);
    return found && found.stretches.map((/** @type {any} */ { from_ns, to_ns }) => ({ from_ms: from_ns / 1e6, to_ms: to_ns / 1e6 }));
  }
}
