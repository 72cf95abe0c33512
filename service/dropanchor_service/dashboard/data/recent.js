/** The stored track of the selected tag over the last minutes, requested anew from time to time. */

import { readTracks } from "./track_reader.js";

const RECENT_MS = 600_000;
const POINTS = 300;
const REQUEST_MS = 10_000;

export class RecentTrack extends EventTarget {
  /** @type {import("./tracks.js").Track | null} */
  #track = null;
  /** @type {string | null} */
  #tag = null;
  #requestedAt = -Infinity;

  /** @param {string | null} tag */
  of(tag) {
    return tag !== null && tag === this.#tag ? this.#track : null;
  }

  /** Request the track of a tag, unless that was done a while ago. @param {string | null} tag @param {number} [end_ms] UTC */
  async request(tag, end_ms = Date.now()) {
    if (tag === this.#tag && performance.now() - this.#requestedAt < REQUEST_MS) return;
    if (tag !== this.#tag) this.#track = null;
    [this.#tag, this.#requestedAt] = [tag, performance.now()];
    if (tag === null) return;
    const found = await readTracks(end_ms - RECENT_MS, end_ms, POINTS, { tag }).catch(() => null);
    if (tag !== this.#tag) return;
    this.#track = found?.get(tag) ?? null;
    this.dispatchEvent(new Event("change"));
  }
}
