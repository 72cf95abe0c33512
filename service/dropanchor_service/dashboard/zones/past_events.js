/** The events of the period of the past that is shown. */

import { api, getJson } from "../data/connection.js";
import { nanoseconds } from "../data/track_reader.js";
import { t } from "../i18n/language.js";

/** @typedef {import("./words.js").ServiceEvent} ServiceEvent */

const MOST = 1000;

/** Event: "change". */
export class PastEvents extends EventTarget {
  /** Newest first, the first 1,000 of the period. @type {ServiceEvent[]} */
  events = [];
  /** Whether they are known. */
  current = false;
  none = t("events.past_none");
  #isCut = false;
  #period = "";

  /** @param {import("../data/periods.js").Period} period */
  async load({ from_ms, to_ms }) {
    const period = `${from_ms}/${to_ms}`;
    if (period === this.#period) return;
    [this.#period, this.events, this.current] = [period, [], false];
    const url = api("events");
    url.search = new URLSearchParams({ since: nanoseconds(from_ms), limit: String(MOST) }).toString();
    const found = await getJson(url).catch(() => null);
    if (period !== this.#period) return;
    this.events = (found?.events ?? []).filter((/** @type {ServiceEvent} */ { time }) => Date.parse(time) <= to_ms).reverse();
    this.current = found !== null;
    this.#isCut = this.events.length === MOST;
    this.dispatchEvent(new Event("change"));
  }

  /** What to know about the list. */
  get note() {
    if (!this.current) return t("events.past_missing");
    return this.#isCut ? t("events.past_cut", { n: MOST }) : "";
  }

  /** When each happened, in ms. */
  get times() {
    return this.events.map(({ time }) => Date.parse(time));
  }
}
