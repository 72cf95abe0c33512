/** The tiles of the base map, ready to be drawn. They come from the service when they are wanted. */

import { request } from "../data/access.js";
import { api } from "../data/connection.js";
import { styleOf } from "./style.js";
import { featuresOf, trace } from "./vector_tile.js";

/** @typedef {import("./mercator.js").TileId} TileId */
/** @typedef {ImageBitmap | Map<string, Path2D>} Content an image, or for each style of `style.js` its lines, with the tile from 0 to 1 */
/** @typedef {{state: "loading" | "failed" | "missing", content: null} | {state: "ready", content: Content}} Entry */

export const VECTOR = "application/vnd.mapbox-vector-tile";
const LOADS = 4;
const KEPT = 160;
const RETRY_MS = 10_000;
const NO_CONTENT = 204;

/** Event: "change", when a tile has arrived or is worth another request. */
export class Tiles extends EventTarget {
  /** Grows with every change. */
  version = 0;
  /** The last used ones come last. @type {Map<string, Entry>} */
  #entries = new Map();
  #loading = 0;
  #media_type = "";

  /** Forget all tiles. @param {string} media_type of the tiles from now on */
  reset(media_type) {
    this.#entries = new Map();
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
    const entry = this.#entries.get(key);
    if (!entry) return null;
    this.#entries.delete(key);
    this.#entries.set(key, entry);
    return entry;
  }

  /** Request those of these tiles that are unknown, the first ones first, a few at a time: "change" asks for the next.
   * @param {TileId[]} tiles */
  want(tiles) {
    for (const tile of tiles) {
      if (this.#loading >= LOADS) return;
      if (!this.#entries.has(keyOf(tile))) this.#load(tile);
    }
  }

  /** @param {TileId} tile */
  async #load(tile) {
    const [entries, key] = [this.#entries, keyOf(tile)];
    entries.set(key, { state: "loading", content: null });
    this.#loading++;
    try {
      const response = await request(api(`basemap/${key}`), { cache: "default" });
      const content = response.status === NO_CONTENT ? null : await contentOf(response, this.#media_type);
      entries.set(key, content ? { state: "ready", content } : { state: "missing", content: null });
    } catch {
      entries.set(key, { state: "failed", content: null }); // the connection of the page says what is wrong
      setTimeout(() => entries.delete(key) && this.#changed(), RETRY_MS);
    }
    this.#loading--;
    for (const oldest of [...entries.keys()].slice(0, Math.max(0, entries.size - KEPT))) entries.delete(oldest);
    this.#changed();
  }

  #changed() {
    this.version++;
    this.dispatchEvent(new Event("change"));
  }
}

/** Return the path of a tile in the interface. The number of a column repeats around the Earth. @param {TileId} tile */
const keyOf = ({ z, x, y }) => `${z}/${((x % 2 ** z) + 2 ** z) % 2 ** z}/${y}`;

/** @param {Response} response @param {string} media_type @returns {Promise<Content>} */
async function contentOf(response, media_type) {
  if (media_type !== VECTOR) return createImageBitmap(await response.blob());
  return pathsOf(new Uint8Array(await response.arrayBuffer()));
}

/** @param {Uint8Array} content */
function pathsOf(content) {
  /** @type {Map<string, Path2D>} */
  const paths = new Map();
  for (const feature of featuresOf(content)) {
    const style = styleOf(feature.layer, feature.kind, feature.type);
    if (!style) continue;
    let path = paths.get(style);
    if (!path) paths.set(style, (path = new Path2D()));
    trace(path, feature);
  }
  return paths;
}
