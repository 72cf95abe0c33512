/** What is drawn of a tile: its image, or the lines of a vector tile by their style. */

import { styleOf } from "./style.js";
import { featuresOf, trace } from "./vector_tile.js";

/** @typedef {ImageBitmap | Map<string, Path2D>} Content by styles of `style.js`, with the tile from 0 to 1 */

export const VECTOR = "application/vnd.mapbox-vector-tile";

/** Throws an error for a tile that cannot be read. @param {ArrayBuffer} bytes @param {string} media_type @returns {Promise<Content>} */
export async function contentOf(bytes, media_type) {
  return media_type === VECTOR ? pathsOf(new Uint8Array(bytes)) : createImageBitmap(new Blob([bytes], { type: media_type }));
}

/** @param {Uint8Array} tile */
function pathsOf(tile) {
  /** @type {Map<string, Path2D>} */
  const paths = new Map();
  for (const feature of featuresOf(tile)) {
    const style = styleOf(feature.layer, feature.kind, feature.type);
    if (!style) continue;
    let path = paths.get(style);
    if (!path) paths.set(style, (path = new Path2D()));
    trace(path, feature);
  }
  return paths;
}
