/** Stored events that somebody looks for: of a tag, a type, a zone or a time; page by page, the newest first. */

import { saveFile } from "../data/save_file.js";
import { api, getJson } from "../data/connection.js";
import { nanoseconds } from "../data/track_reader.js";
import { t } from "../i18n/language.js";

/** @typedef {import("./words.js").ServiceEvent} ServiceEvent */
/** @typedef {{tag?: string, type?: string, zone?: string, from_ms?: number | null, to_ms?: number | null}} Wanted what is missing or empty selects all */

const PAGE = 500;

/** Event: "change". */
export class FoundEvents extends EventTarget {
  /** Newest first. @type {ServiceEvent[]} */
  events = [];
  /** Whether they are known. */
  current = false;
  none = t("events.none_found");
  /** Whether there are older ones. */
  hasMore = false;
  /** @type {Wanted} */
  #wanted = {};
  #asked = 0;

  /** Load the newest events that are wanted. @param {Wanted} wanted */
  async find(wanted) {
    if (JSON.stringify(wanted) === JSON.stringify(this.#wanted) && this.current) return;
    [this.#wanted, this.events, this.current] = [wanted, [], false];
    await this.more();
  }

  /** Load those before the ones that are known. */
  async more() {
    const asked = ++this.#asked;
    const url = eventsUrl("events", this.#wanted);
    url.searchParams.set("limit", String(PAGE));
    url.searchParams.set("before", this.events.at(-1)?.sequence ?? String(Number.MAX_SAFE_INTEGER));
    const found = await getJson(url).catch(() => null);
    if (asked !== this.#asked) return;
    this.events = [...this.events, ...(found?.events ?? []).reverse()];
    this.hasMore = found?.events.length === PAGE;
    this.current = found !== null;
    this.dispatchEvent(new Event("change"));
  }

  /** Take an event that has just happened. @param {ServiceEvent} event */
  take(event) {
    const { tag, type, zone, from_ms, to_ms } = this.#wanted;
    const time_ms = Date.parse(event.time);
    const isWanted = (!tag || event.subject === tag) && (!type || event.type === type) && (!zone || event.data.zone === zone)
      && time_ms >= (from_ms ?? -Infinity) && time_ms <= (to_ms ?? Infinity);
    if (!isWanted || !this.current || event.sequence <= (this.events[0]?.sequence ?? "")) return;
    this.events = [event, ...this.events];
    this.dispatchEvent(new Event("change"));
  }

  /** What to know about the list. */
  get note() {
    return this.current ? "" : t("events.not_loaded");
  }

  /** When each happened, in ms. */
  get times() {
    return this.events.map(({ time }) => Date.parse(time));
  }
}

/** Save all that are wanted, however many. @param {Wanted} wanted @param {"csv" | "jsonl"} format */
export async function saveEvents(wanted, format) {
  const url = eventsUrl("events/file", wanted);
  url.searchParams.set("format", format);
  await saveFile(url, `events.${format}`);
}

/** @param {string} path @param {Wanted} wanted */
function eventsUrl(path, { tag, type, zone, from_ms, to_ms }) {
  const url = api(path);
  const times = { since: from_ms && nanoseconds(from_ms), to: to_ms && nanoseconds(to_ms) };
  for (const [name, value] of Object.entries({ types: type, ...times })) if (value) url.searchParams.set(name, value);
  for (const [name, value] of Object.entries({ tags: tag, zones: zone })) if (value) appendId(url.searchParams, name, value);
  return url;
}

/** A single id with a comma is given twice. @param {URLSearchParams} search @param {string} name @param {string} id */
function appendId(search, name, id) {
  for (let i = 0; i < (id.includes(",") ? 2 : 1); i++) search.append(name, id);
}
