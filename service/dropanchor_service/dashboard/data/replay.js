/** A period of the past, and a clock that runs through it. Tracks are loaded piece by piece, ahead of the clock. */

import { api, getJson } from "./connection.js";
import { Track } from "./tracks.js";
import { t } from "../i18n/language.js";

export const SPEEDS = [0.5, 1, 2, 5, 10, 20, 50];
const PIECE_POINTS = 60_000;
/** Each piece begins so much earlier, so that trails and tags that were silent for a moment are in it. */
const BEFORE_MS = 60_000;
const [SHORTEST_MS, LONGEST_MS] = [60_000, 1_800_000];
/** A piece is requested when the clock is so much of a piece before it. */
const AHEAD = 0.5;

/** @typedef {{from_ms: number, to_ms: number, tracks: Track[]}} Piece */

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
  #speed = 1;
  /** Figures and thinned points of every tag over the whole period. @type {Map<string, import("./tracks.js").TagTrack>} */
  figures = new Map();
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

  /** Show a period from its first moment, or from another. @param {number} from_ms @param {number} to_ms @param {number} [time_ms] */
  async open(from_ms, to_ms, time_ms = from_ms) {
    this.close();
    [this.from_ms, this.to_ms, this.playing] = [from_ms, to_ms, false];
    this.time_ms = Math.min(to_ms, Math.max(from_ms, time_ms));
    this.dispatchEvent(new Event("period"));
    const found = await this.#request(from_ms, to_ms, 300);
    if (!found) return;
    this.figures = new Map(found.map((track) => [track.tag, track]));
    this.isLoaded = true;
    this.dispatchEvent(new Event("period"));
    await this.seek(this.time_ms);
  }

  close() {
    this.#asked.abort();
    this.#asked = new AbortController();
    this.#pieces = [];
    this.figures = new Map();
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

  /** Let the clock run on, unless the next piece is still missing. @param {number} elapsed_ms */
  advance(elapsed_ms) {
    if (!this.playing || this.loading) return;
    this.seek(this.time_ms + elapsed_ms * this.#speed);
    this.#load(this.time_ms + AHEAD * this.#pieceLength);
    if (this.time_ms >= this.to_ms) this.play(false);
  }

  /** Return the tracks around the current time; none while they are loading. */
  get tracks() {
    return this.#pieceAt(this.time_ms)?.tracks ?? [];
  }

  get #pieceLength() {
    const length = (PIECE_POINTS / Math.max(1, this.figures.size)) * 1000;
    return Math.min(LONGEST_MS, Math.max(SHORTEST_MS, Math.floor(length / 1000) * 1000));
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
    const waiting = this.#waiting.get(from_ms) ?? this.#loadPiece(from_ms, from_ms + length);
    this.#waiting.set(from_ms, waiting);
    this.#isLoading(!this.#pieceAt(this.time_ms));
    await waiting;
    this.#waiting.delete(from_ms);
    this.#isLoading(!this.#pieceAt(this.time_ms) && this.problem === "");
    this.dispatchEvent(new Event("time"));
  }

  /** @param {number} from_ms @param {number} to_ms */
  async #loadPiece(from_ms, to_ms) {
    const points = Math.min(5000, Math.ceil((to_ms - from_ms + BEFORE_MS) / 1000) + 2);
    const found = await this.#request(from_ms - BEFORE_MS, to_ms, points);
    if (!found) return;
    const near = this.#pieces.filter((piece) => Math.abs(piece.from_ms - from_ms) <= 2 * (to_ms - from_ms));
    this.#pieces = [...near, { from_ms, to_ms, tracks: found.map((track) => new Track(track)) }];
  }

  /** @param {boolean} loading */
  #isLoading(loading) {
    if (loading === this.loading) return;
    this.loading = loading;
    this.dispatchEvent(new Event("state"));
  }

  /** @param {number} from_ms @param {number} to_ms @param {number} points @returns {Promise<import("./tracks.js").TagTrack[] | null>} */
  async #request(from_ms, to_ms, points) {
    const { signal } = this.#asked;
    try {
      const { tracks } = await getJson(tracksUrl(from_ms, to_ms, points));
      if (signal.aborted) return null;
      this.problem = "";
      return tracks;
    } catch {
      if (signal.aborted) return null;
      this.problem = t("past.unreadable");
      this.playing = false;
      this.dispatchEvent(new Event("state"));
      return null;
    }
  }
}

/** Return the URL of the thinned tracks over a period. @param {number} from_ms @param {number} to_ms @param {number} points of each tag
 * @param {string} [tag] only of this one */
export function tracksUrl(from_ms, to_ms, points, tag) {
  const url = api("tracks");
  url.search = new URLSearchParams({
    from: nanoseconds(from_ms), to: nanoseconds(to_ms), max_points: String(points), ...(tag === undefined ? {} : { tags: tag }),
  }).toString();
  return url;
}

/** @param {number} time_ms */
export const nanoseconds = (time_ms) => `${Math.max(0, Math.round(time_ms))}000000`;
