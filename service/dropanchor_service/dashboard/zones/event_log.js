/** The latest events of the service, kept up to date by its stream. */

import { request } from "../data/access.js";
import { api, getJson } from "../data/connection.js";
import { eventsOf } from "../data/events.js";
import { t } from "../i18n/language.js";

/** @typedef {import("./words.js").ServiceEvent} ServiceEvent */

const KEPT = 100;
const RETRY_MS = 1000;

/** Return the newest events, newest first, each once. @param {ServiceEvent[]} added oldest first @param {ServiceEvent[]} before */
export function newestFirst(added, before) {
  const known = new Set(before.map(({ sequence }) => sequence));
  const fresh = added.filter(({ sequence }) => !known.has(sequence)).reverse();
  return [...fresh, ...before].slice(0, KEPT);
}

/** Return why events are not true, by their ids. @param {ServiceEvent[]} events @returns {Map<string, string>} */
export function retractedBy(events) {
  return new Map(events.flatMap(({ data }) => (data.retracts ? [[data.retracts, data.reason ?? ""]] : [])));
}

/** Events: "change", and "event" (detail: ServiceEvent) for each that happens from now on. */
export class EventLog extends EventTarget {
  /** Newest first. @type {ServiceEvent[]} */
  events = [];
  /** Whether the stream of events is connected, so that none is missing. */
  current = false;
  none = t("events.none");
  #stream = new AbortController();
  #timer = 0;

  /** Load the newest events and follow the stream. Connect again until `stop`. */
  async start() {
    this.stop();
    const { signal } = this.#stream;
    try {
      await this.#follow(signal);
    } catch {
      // The page's connection says what is wrong.
    }
    if (signal.aborted) return;
    this.#become(false);
    this.#timer = setTimeout(() => this.start(), RETRY_MS);
  }

  /** Whether there are older ones. */
  get hasMore() {
    return this.events.length === KEPT;
  }

  /** What to know about the list. */
  get note() {
    if (!this.current) return t("events.missing");
    return this.events.length === 0 ? t("events.nothing") : "";
  }

  stop() {
    clearTimeout(this.#timer);
    this.#stream.abort();
    this.#stream = new AbortController();
    this.#become(false);
  }

  /** @param {AbortSignal} signal */
  async #follow(signal) {
    const { events } = await getJson(api(`events?limit=${KEPT}`));
    const response = await request(api(`events/stream?after=${events.at(-1)?.sequence ?? 0}`), { signal });
    this.events = newestFirst(events, []);
    this.#become(true);
    for await (const { data } of eventsOf(response)) {
      const event = JSON.parse(data);
      this.events = newestFirst([event], this.events);
      this.dispatchEvent(new CustomEvent("event", { detail: event }));
      this.dispatchEvent(new Event("change"));
    }
  }

  /** @param {boolean} current */
  #become(current) {
    this.current = current;
    this.dispatchEvent(new Event("change"));
  }
}
