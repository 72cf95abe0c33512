/** Paint tiles on a canvas whose edges are those of a part of the site. */

import { siteAt } from "./mercator.js";
import { STYLES, widthOf } from "./style.js";

/** @typedef {import("./mercator.js").TileId} TileId */
/** @typedef {import("./tile_content.js").Content} Content */
/**
 * @typedef {object} Painting
 * @property {number} left of the canvas, m @property {number} top m
 * @property {number} width of the canvas, pixels @property {number} height pixels
 * @property {number} scale pixels of the style sheet per metre @property {number} ratio pixels of the canvas for one of these
 * @property {import("./mercator.js").Affine} affine
 * @property {{tile: TileId, key: string}[]} tiles the coarsest first
 * @property {Record<string, string>} colours those of the style sheet for the map and base maps
 * @property {boolean} isDark
 */

/** Images are faded, so that tags stand out, and more so on a dark page, since most images are light. */
const OPACITY = 0.7;
const DARK_OPACITY = 0.5;
/** Share of a tile by which its ground reaches beyond it, so that no gap shows between two. */
const OVERLAP = 0.002;

/** @param {OffscreenCanvas | HTMLCanvasElement} canvas @param {Painting} painting @param {(key: string) => Content | undefined} find */
export function paint(canvas, painting, find) {
  Object.assign(canvas, { width: painting.width, height: painting.height }); // clears it
  const ctx = /** @type {OffscreenCanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const tiles = painting.tiles.map(({ tile, key }) => ({ tile, content: find(key) }));
  for (const z of new Set(tiles.map(({ tile }) => tile.z))) {
    const level = tiles.filter(({ tile }) => tile.z === z);
    paintImages(ctx, painting, level);
    paintVectors(ctx, painting, level);
  }
}

/** @param {OffscreenCanvasRenderingContext2D} ctx @param {Painting} painting @param {{tile: TileId, content?: Content}[]} tiles */
function paintImages(ctx, painting, tiles) {
  ctx.fillStyle = painting.colours.map;
  for (const { tile, content } of tiles) {
    if (!(content instanceof ImageBitmap)) continue;
    const edge = 1 + 0.5 / place(ctx, painting, tile); // no gap between two turned tiles
    ctx.fillRect(0, 0, edge, edge);
    ctx.globalAlpha = painting.isDark ? DARK_OPACITY : OPACITY;
    ctx.drawImage(content, 0, 0, edge, edge);
    ctx.globalAlpha = 1;
  }
}

/** @param {OffscreenCanvasRenderingContext2D} ctx @param {Painting} painting @param {{tile: TileId, content?: Content}[]} tiles */
function paintVectors(ctx, painting, tiles) {
  const vectors = tiles.flatMap(({ tile, content }) => (content instanceof Map ? [{ tile, content }] : []));
  ctx.fillStyle = painting.colours["base-land"];
  for (const { tile } of vectors) {
    place(ctx, painting, tile);
    ctx.fillRect(-OVERLAP, -OVERLAP, 1 + 2 * OVERLAP, 1 + 2 * OVERLAP);
  }
  ctx.lineJoin = ctx.lineCap = "round";
  for (const [name, style] of Object.entries(STYLES)) {
    ctx.fillStyle = ctx.strokeStyle = painting.colours[style.colour];
    for (const { tile, content } of vectors) {
      const path = content.get(name);
      if (!path) continue;
      ctx.lineWidth = (widthOf(style, painting.scale) * painting.ratio) / place(ctx, painting, tile);
      if (style.least_px === undefined) ctx.fill(path);
      else ctx.stroke(path);
    }
  }
}

/** Let the canvas draw a tile from 0 to 1. Return the length of its edge in pixels.
 * @param {OffscreenCanvasRenderingContext2D} ctx @param {Painting} painting @param {TileId} tile */
function place(ctx, { left, top, scale, ratio, affine }, { z, x, y }) {
  const { a, b, c, d } = affine;
  const [per_m, size] = [scale * ratio, 2 ** z];
  const [site_x, site_y] = siteAt(affine, x / size, y / size);
  const slopes = [a, -b, c, -d].map((slope) => (per_m * slope) / size);
  ctx.setTransform(slopes[0], slopes[1], slopes[2], slopes[3], per_m * (site_x - left), per_m * (top - site_y));
  return (per_m * Math.hypot(a, b)) / size;
}
