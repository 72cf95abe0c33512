/** The stored tracks of the selected tags: of the last minutes, requested anew from time to time, or of a period of the past. */

import { NO_TRACKS } from "./tracks.js";
import { readTracks } from "./track_reader.js";

const RECENT_MS = 600_000;
const POINTS = 300;
const POINTS_OF_THE_PAST = 5000; // the most that the service gives
const REQUEST_MS = 10_000;
/** More tracks on one map cannot be told apart. */
export const MOST_TRACKS = 20;

export class ChosenTracks extends EventTarget {
  #tracks = NO_TRACKS;
  #asked = "";
  #requestedAt = -Infinity;

  /** @param {string | null} tag */
  of(tag) {
    return this.#tracks.get(tag);
  }

  /** Request the recent tracks of these tags, unless that was done a while ago. @param {readonly string[]} tags @param {number} [end_ms] UTC */
  request(tags, end_ms = Date.now()) {
    return this.#request(tags, end_ms - RECENT_MS, end_ms, POINTS, "", REQUEST_MS);
  }

  /** Request the tracks of these tags over a period, once. @param {readonly string[]} tags @param {number} from_ms UTC @param {number} to_ms */
  requestPeriod(tags, from_ms, to_ms) {
    return this.#request(tags, from_ms, to_ms, POINTS_OF_THE_PAST, `${from_ms} ${to_ms}`, Infinity);
  }

  /** @param {readonly string[]} tags @param {number} from_ms @param {number} to_ms @param {number} points @param {string} period @param {number} valid_ms */
  async #request(tags, from_ms, to_ms, points, period, valid_ms) {
    const wanted = tags.slice(0, MOST_TRACKS);
    const asked = JSON.stringify([period, wanted]);
    if (asked === this.#asked && performance.now() - this.#requestedAt < valid_ms) return;
    if (asked !== this.#asked) this.#tracks = NO_TRACKS;
    [this.#asked, this.#requestedAt] = [asked, performance.now()];
    if (wanted.length === 0) return;
    const found = await readTracks(from_ms, to_ms, points, { tags: wanted }).catch(() => null);
    if (asked !== this.#asked) return;
    this.#tracks = found ?? NO_TRACKS;
    this.dispatchEvent(new Event("change"));
  }
}
