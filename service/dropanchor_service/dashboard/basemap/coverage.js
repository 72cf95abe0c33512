/** Which tiles a view needs: one zoom level that suits its scale, and coarser tiles where those are not there (yet). */

import { edgeOf, mercatorAt, tilesIn } from "./mercator.js";

/** @typedef {import("./mercator.js").TileId} TileId */
/** @typedef {import("./tiles.js").State} State */
/** @typedef {import("./mercator.js").World & {min_zoom: number, max_zoom: number}} Extent of a map */

const MOST_TILES = 64;

/** Return the tiles for a part of the site, the nearest to its middle first; none where they would be too many.
 * @param {import("./mercator.js").Affine} affine @param {import("../map/view.js").Bounds} bounds
 * @param {number} scale pixels per metre @param {number} tile_px for which tiles are made @param {Extent} extent @returns {TileId[]} */
export function tilesFor(affine, bounds, scale, tile_px, extent) {
  const suited = Math.round(Math.log2((edgeOf(affine) * scale) / tile_px));
  for (let z = Math.max(extent.min_zoom, Math.min(extent.max_zoom, suited)); z >= extent.min_zoom; z--) {
    const found = tilesIn(affine, bounds, extent, z, MOST_TILES);
    if (found) return sorted(found, affine, bounds);
  }
  return [];
}

/** @param {TileId[]} tiles @param {import("./mercator.js").Affine} affine @param {import("../map/view.js").Bounds} bounds */
function sorted(tiles, affine, { left, right, bottom, top }) {
  const [mx, my] = mercatorAt(affine, (left + right) / 2, (bottom + top) / 2);
  const far = (/** @type {TileId} */ { z, x, y }) => Math.hypot(x + 0.5 - mx * 2 ** z, y + 0.5 - my * 2 ** z);
  return tiles.sort((one, other) => far(one) - far(other));
}

/**
 * Return the tiles that can be drawn instead of the wanted ones, the coarsest first, and those to request. A coarser tile
 * stands in for one that is on its way, and for an image that the map does not have.
 * @param {TileId[]} wanted @param {(tile: TileId) => State | null} find @param {number} min_zoom @param {boolean} isVector
 * @returns {{drawn: TileId[], requested: TileId[]}}
 */
export function standIns(wanted, find, min_zoom, isVector) {
  /** @type {Map<string, TileId>} */
  const drawn = new Map();
  const requested = [];
  for (const one of wanted) {
    let asks = true;
    for (let tile = one; tile.z >= min_zoom; tile = parentOf(tile)) {
      const state = find(tile) ?? "unknown";
      if (state === "ready") drawn.set(`${tile.z}/${tile.x}/${tile.y}`, tile);
      if (state === "unknown" && asks) requested.push(tile);
      if (state === "ready" || (state === "missing" && isVector)) break;
      asks &&= state === "missing";
    }
  }
  return { drawn: [...drawn.values()].sort((one, other) => one.z - other.z), requested };
}

/** @param {TileId} tile @returns {TileId} */
const parentOf = ({ z, x, y }) => ({ z: z - 1, x: Math.floor(x / 2), y: Math.floor(y / 2) });
