/** A period of the past, and a clock that runs through it. Tracks are loaded piece by piece, ahead of the clock. */

import { NO_TRACKS } from "./tracks.js";
import { readTracks } from "./track_reader.js";
import { t } from "../i18n/language.js";

export const SPEEDS = [0.5, 1, 2, 5, 10, 20, 50, 200];
/** Tags times seconds of a piece, and of the time before it. The service reads twice as many pose by pose. */
const PIECE_POSES = 100_000;
const [SHORTEST_MS, LONGEST_MS] = [10_000, 600_000];
/** Each piece begins up to so much earlier, so that trails and tags that were silent for a moment are in it. */
const MOST_BEFORE_MS = 60_000;
/** A piece is requested when the clock is so much of a piece before it. */
const AHEAD = 0.5;

/** @typedef {{from_ms: number, to_ms: number, tracks: import("./tracks.js").Tracks}} Piece */

/**
 * Events: "time" (the time or what is known at it has changed), "period" (another period, or its figures have arrived),
 * "state" (playing, loading, speed or problem have changed).
 */
export class Replay extends EventTarget {
  from_ms = 0;
  to_ms = 0;
  time_ms = 0;
  playing = false;
  loading = false;
  problem = "";
  /** Whether the figures of the period have arrived. */
  isLoaded = false;
  /** Return the end of the pause at a time, if nothing worth seeing happens then and a person wants to skip that; the time itself otherwise. */
  afterPause = (/** @type {number} */ time_ms) => time_ms;
  #speed = 1;
  /** Figures and thinned points of every tag over the whole period. */
  figures = NO_TRACKS;
  /** @type {Piece[]} */
  #pieces = [];
  #asked = new AbortController();

  get speed() {
    return this.#speed;
  }

  set speed(speed) {
    this.#speed = SPEEDS.includes(speed) ? speed : 1;
    this.dispatchEvent(new Event("state"));
  }

  /** Show a period from its first pose, or from another moment. @param {number} from_ms @param {number} to_ms @param {number} [time_ms] */
  async open(from_ms, to_ms, time_ms) {
    this.close();
    [this.from_ms, this.to_ms, this.playing] = [from_ms, to_ms, false];
    this.time_ms = Math.min(to_ms, Math.max(from_ms, time_ms ?? from_ms));
    this.loading = true;
    this.dispatchEvent(new Event("period"));
    const found = await this.#request(from_ms, to_ms, 300);
    if (!found) return;
    this.figures = found;
    this.isLoaded = true;
    if (time_ms === undefined && this.time_ms === from_ms) this.time_ms = Math.max(from_ms, found.first_ms ?? from_ms);
    this.dispatchEvent(new Event("period"));
    await this.seek(this.time_ms);
  }

  close() {
    this.#asked.abort();
    this.#asked = new AbortController();
    this.#pieces = [];
    this.figures = NO_TRACKS;
    this.playing = this.loading = this.isLoaded = false;
  }

  /** @param {boolean} on */
  play(on) {
    if (on && this.time_ms >= this.to_ms) this.seek(this.from_ms);
    this.playing = on;
    this.dispatchEvent(new Event("state"));
  }

  /** Go to a time. @param {number} time_ms */
  async seek(time_ms) {
    this.time_ms = Math.min(this.to_ms, Math.max(this.from_ms, time_ms));
    this.dispatchEvent(new Event("time"));
    await this.#load(this.time_ms);
  }

  /** Let the clock run on. It waits at the end of a piece while the next one is missing, and the tags stay where they are.
   * @param {number} elapsed_ms */
  advance(elapsed_ms) {
    if (!this.playing || this.loading) return;
    const next_ms = Math.min(this.to_ms, this.afterPause(this.time_ms + elapsed_ms * this.#speed));
    if (this.#pieceAt(this.time_ms) && !this.#pieceAt(next_ms)) return void this.#load(next_ms);
    this.seek(next_ms);
    this.#load(next_ms + AHEAD * this.#pieceLength);
    if (this.time_ms >= this.to_ms) this.play(false);
  }

  /** Return the tracks around the current time; none after a jump, while they are loading. */
  get tracks() {
    return this.#pieceAt(this.time_ms)?.tracks ?? NO_TRACKS;
  }

  get #pieceLength() {
    return pieceLength(this.figures.size);
  }

  /** @param {number} time_ms */
  #pieceAt(time_ms) {
    return this.#pieces.find(({ from_ms, to_ms }) => time_ms >= from_ms && time_ms < to_ms) ?? null;
  }

  /** @type {Map<number, Promise<void>>} */
  #waiting = new Map();

  /** Load the piece that holds a time, once. @param {number} time_ms */
  async #load(time_ms) {
    if (time_ms > this.to_ms || this.#pieceAt(time_ms)) return;
    const length = this.#pieceLength;
    const from_ms = Math.floor(time_ms / length) * length;
    this.#isLoading(!this.#pieceAt(this.time_ms));
    if (!this.#waiting.has(from_ms)) this.#waiting.set(from_ms, this.#loadAndTell(from_ms, from_ms + length));
    await this.#waiting.get(from_ms);
  }

  /** @param {number} from_ms @param {number} to_ms */
  async #loadAndTell(from_ms, to_ms) {
    await this.#loadPiece(from_ms, to_ms);
    this.#waiting.delete(from_ms);
    this.#isLoading(!this.#pieceAt(this.time_ms) && this.problem === "");
    this.dispatchEvent(new Event("time"));
  }

  /** @param {number} from_ms @param {number} to_ms */
  async #loadPiece(from_ms, to_ms) {
    const start_ms = from_ms - Math.min(MOST_BEFORE_MS, to_ms - from_ms);
    const found = await this.#request(start_ms, to_ms, Math.ceil((to_ms - start_ms) / 1000) + 2);
    if (!found) return;
    const near = this.#pieces.filter((piece) => Math.abs(piece.from_ms - from_ms) <= 2 * (to_ms - from_ms));
    this.#pieces = [...near, { from_ms, to_ms, tracks: found }];
  }

  /** @param {boolean} loading */
  #isLoading(loading) {
    if (loading === this.loading) return;
    this.loading = loading;
    this.dispatchEvent(new Event("state"));
  }

  /** @param {number} from_ms @param {number} to_ms @param {number} points @returns {Promise<import("./tracks.js").Tracks | null>} */
  async #request(from_ms, to_ms, points) {
    const { signal } = this.#asked;
    try {
      const tracks = await readTracks(from_ms, to_ms, points, { signal });
      if (signal.aborted) return null;
      this.problem = "";
      return tracks;
    } catch {
      if (signal.aborted) return null;
      this.problem = t("past.unreadable");
      this.playing = this.loading = false;
      this.dispatchEvent(new Event("state"));
      return null;
    }
  }
}

/** Return the length of a piece in ms. @param {number} tags */
export function pieceLength(tags) {
  const seconds = Math.floor(PIECE_POSES / Math.max(1, tags));
  return Math.min(LONGEST_MS, Math.max(SHORTEST_MS, seconds * 1000));
}
