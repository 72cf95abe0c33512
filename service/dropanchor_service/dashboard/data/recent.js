/** The stored tracks of the selected tags over the last minutes, requested anew from time to time. */

import { NO_TRACKS } from "./tracks.js";
import { readTracks } from "./track_reader.js";

const RECENT_MS = 600_000;
const POINTS = 300;
const REQUEST_MS = 10_000;
/** More tracks on one map cannot be told apart. */
export const MOST_TRACKS = 20;

export class RecentTracks extends EventTarget {
  #tracks = NO_TRACKS;
  #asked = "";
  #requestedAt = -Infinity;

  /** @param {string | null} tag */
  of(tag) {
    return this.#tracks.get(tag);
  }

  /** Request the tracks of these tags, unless that was done a while ago. @param {readonly string[]} tags @param {number} [end_ms] UTC */
  async request(tags, end_ms = Date.now()) {
    const wanted = tags.slice(0, MOST_TRACKS);
    const asked = JSON.stringify(wanted);
    if (asked === this.#asked && performance.now() - this.#requestedAt < REQUEST_MS) return;
    if (asked !== this.#asked) this.#tracks = NO_TRACKS;
    [this.#asked, this.#requestedAt] = [asked, performance.now()];
    if (wanted.length === 0) return;
    const found = await readTracks(end_ms - RECENT_MS, end_ms, POINTS, { tags: wanted }).catch(() => null);
    if (asked !== this.#asked) return;
    this.#tracks = found ?? NO_TRACKS;
    this.dispatchEvent(new Event("change"));
  }
}
