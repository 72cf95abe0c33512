/** The tiles of the base map: they come from the service when they are wanted, and go to the thread that paints them. */

import { request } from "../data/access.js";
import { api } from "../data/connection.js";

/** @typedef {import("./mercator.js").TileId} TileId */
/** @typedef {"loading" | "failed" | "missing" | "ready"} State */

const LOADS = 4;
const KEPT = 160;
const RETRY_MS = 10_000;
const NO_CONTENT = 204;

/** Event: "change", when a tile has arrived or is worth another request. */
export class Tiles extends EventTarget {
  /** Grows with every change. */
  version = 0;
  /** By key; the last used ones come last. @type {Map<string, State>} */
  #states = new Map();
  #loading = 0;
  #media_type = "";

  /** @param {import("./thread.js").PaintingThread} thread */
  constructor(thread) {
    super();
    this.thread = thread;
  }

  /** Forget all tiles. @param {string} media_type of the tiles from now on */
  reset(media_type) {
    for (const key of this.#states.keys()) this.thread.forget(key);
    this.#states = new Map();
    this.#media_type = media_type;
    this.#changed();
  }

  /** Return whether no tile is on its way. */
  get still() {
    return this.#loading === 0;
  }

  /** Return what is known of a tile. @param {TileId} tile */
  find(tile) {
    const key = keyOf(tile);
    const state = this.#states.get(key);
    if (!state) return null;
    this.#states.delete(key);
    this.#states.set(key, state);
    return state;
  }

  /** Request those of these tiles that are unknown, the first ones first, a few at a time: "change" asks for the next.
   * @param {TileId[]} tiles */
  want(tiles) {
    for (const tile of tiles) {
      if (this.#loading >= LOADS) return;
      if (!this.#states.has(keyOf(tile))) this.#load(keyOf(tile));
    }
  }

  /** @param {string} key */
  async #load(key) {
    const states = this.#states;
    states.set(key, "loading");
    this.#loading++;
    const state = await this.#requested(key).catch(() => "failed"); // the connection of the page says what is wrong
    this.#loading--;
    if (states === this.#states) this.#note(key, /** @type {State} */ (state));
    else this.thread.forget(key);
    this.#changed();
  }

  /** @param {string} key @returns {Promise<State>} */
  async #requested(key) {
    const response = await request(api(`basemap/${key}`), { cache: "default" });
    if (response.status === NO_CONTENT) return "missing";
    return (await this.thread.read(key, this.#media_type, await response.arrayBuffer())) ? "ready" : "failed";
  }

  /** @param {string} key @param {State} state */
  #note(key, state) {
    this.#states.set(key, state);
    if (state === "failed") setTimeout(() => this.#states.delete(key) && this.#changed(), RETRY_MS);
    for (const oldest of [...this.#states.keys()].slice(0, Math.max(0, this.#states.size - KEPT))) {
      this.#states.delete(oldest);
      this.thread.forget(oldest);
    }
  }

  #changed() {
    this.version++;
    this.dispatchEvent(new Event("change"));
  }
}

/** Return the path of a tile in the interface. The number of a column repeats around the Earth. @param {TileId} tile */
export const keyOf = ({ z, x, y }) => `${z}/${((x % 2 ** z) + 2 ** z) % 2 ** z}/${y}`;
