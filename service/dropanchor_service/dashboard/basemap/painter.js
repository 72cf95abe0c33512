/** Paint the base map on a canvas of its own, a little larger than the view. While the map is moved, only this canvas is
 * drawn; it is painted anew when the view leaves it, at another scale, and when tiles arrive. */

import { standIns, tilesFor } from "./coverage.js";
import { affineAt, siteAt } from "./mercator.js";
import { STYLES, widthOf } from "./style.js";
import { VECTOR } from "./tiles.js";

/** @typedef {import("../map/view.js").View} View @typedef {import("../map/palette.js").Palette} Palette */
/** @typedef {import("./mercator.js").Affine} Affine @typedef {import("./mercator.js").TileId} TileId */
/** @typedef {{media_type: string} & import("./coverage.js").Extent} Description */

/** Share of the view beyond each of its edges. */
const MARGIN = 0.25;
/** Factor of the scale at which the last painting still looks well while the map is zoomed. */
const MAX_ZOOMED = 1.4;
const SETTLED_MS = 120;
const IMAGE_PX = 256;
const VECTOR_PX = 512;
/** Images are made for light pages: on a dark one they are dimmed. */
const DARK_OPACITY = 0.6;
/** Share of a tile by which its ground reaches beyond it, so that no gap shows between two. */
const OVERLAP = 0.002;

export class Painter {
  /** For tests and the console: the last painting. */
  stats = { paintings: 0, ms: 0, zoom: -1, tiles: 0 };
  #canvas = document.createElement("canvas");
  #ctx = /** @type {CanvasRenderingContext2D} */ (this.#canvas.getContext("2d"));
  /** What the canvas shows. */
  #painted = { left: 0, right: 0, bottom: 0, top: 0, scale: 0, ratio: 0, look: "" };
  #settled = 0;
  #lastScale = 0;

  /** @param {import("./tiles.js").Tiles} tiles @param {() => void} redraw draws the map again */
  constructor(tiles, redraw) {
    this.tiles = tiles;
    this.redraw = redraw;
  }

  /** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {Description} description
   * @param {import("../plan/geodesy.js").Georeference} origin */
  draw(ctx, view, palette, description, origin) {
    const ratio = this.#ratioOf(ctx, view);
    const look = [this.tiles.version, document.documentElement.dataset.theme, origin.lat, origin.lon, origin.rotation_rad].join();
    if (!this.#isGood(view, ratio, look)) {
      const begun = performance.now();
      this.#prepare(view, ratio, look);
      this.#paint(palette, description, origin);
      this.stats = { ...this.stats, paintings: this.stats.paintings + 1, ms: performance.now() - begun };
    }
    this.#show(ctx, view, ratio);
  }

  /** Pixels of the canvas for a pixel of the style sheet. @param {CanvasRenderingContext2D} ctx @param {View} view */
  #ratioOf(ctx, view) {
    return ctx.canvas.width / view.width;
  }

  /** Return whether the last painting still serves. A change of the scale waits until the map is no longer zoomed.
   * @param {View} view @param {number} ratio @param {string} look */
  #isGood(view, ratio, look) {
    const [painted, seen] = [this.#painted, view.bounds()];
    if (look !== painted.look || ratio !== painted.ratio) return false;
    if (seen.left < painted.left || seen.right > painted.right || seen.bottom < painted.bottom || seen.top > painted.top) return false;
    if (view.scale === painted.scale) return true;
    const isZooming = view.scale !== this.#lastScale;
    this.#lastScale = view.scale;
    if (!isZooming || Math.abs(Math.log(view.scale / painted.scale)) > Math.log(MAX_ZOOMED)) return false;
    clearTimeout(this.#settled);
    this.#settled = setTimeout(this.redraw, SETTLED_MS);
    return true;
  }

  /** @param {View} view @param {number} ratio @param {string} look */
  #prepare(view, ratio, look) {
    const [across, up] = [(MARGIN * view.width) / view.scale, (MARGIN * view.height) / view.scale];
    const { left, right, bottom, top } = view.bounds();
    this.#painted = { left: left - across, right: right + across, bottom: bottom - up, top: top + up, scale: view.scale, ratio, look };
    const [width, height] = [view.width, view.height].map((side) => Math.ceil(side * (1 + 2 * MARGIN) * ratio));
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    this.#ctx.setTransform(1, 0, 0, 1, 0, 0);
    this.#ctx.clearRect(0, 0, width, height);
  }

  /** @param {Palette} palette @param {Description} description @param {import("../plan/geodesy.js").Georeference} origin */
  #paint(palette, description, origin) {
    const { left, right, bottom, top, scale, ratio } = this.#painted;
    const affine = affineAt(origin, (left + right) / 2, (bottom + top) / 2);
    if (!affine) return;
    const isVector = description.media_type === VECTOR;
    const [made_for, shown] = isVector ? [VECTOR_PX, scale] : [IMAGE_PX, scale * ratio];
    const wanted = tilesFor(affine, this.#painted, shown, made_for, description);
    const { drawn, requested } = standIns(wanted, (tile) => this.tiles.find(tile), description.min_zoom, isVector);
    this.tiles.want(requested);
    for (const z of new Set(drawn.map((tile) => tile.z))) {
      const level = drawn.filter((tile) => tile.z === z);
      if (isVector) this.#paintVectors(level, affine, palette);
      else this.#paintImages(level, affine);
    }
    this.stats = { ...this.stats, zoom: drawn.at(-1)?.z ?? -1, tiles: drawn.length };
  }

  /** @param {TileId[]} tiles @param {Affine} affine */
  #paintImages(tiles, affine) {
    this.#ctx.globalAlpha = document.documentElement.dataset.theme === "dark" ? DARK_OPACITY : 1;
    for (const tile of tiles) {
      const image = this.tiles.find(tile)?.content;
      if (!(image instanceof ImageBitmap)) continue;
      const edge_px = this.#place(tile, affine);
      this.#ctx.drawImage(image, 0, 0, 1 + 0.5 / edge_px, 1 + 0.5 / edge_px); // no gap between two turned tiles
    }
    this.#ctx.globalAlpha = 1;
  }

  /** @param {TileId[]} tiles @param {Affine} affine @param {Palette} palette */
  #paintVectors(tiles, affine, palette) {
    const ctx = this.#ctx;
    ctx.fillStyle = palette["base-land"];
    for (const tile of tiles) {
      this.#place(tile, affine);
      ctx.fillRect(-OVERLAP, -OVERLAP, 1 + 2 * OVERLAP, 1 + 2 * OVERLAP);
    }
    ctx.lineJoin = ctx.lineCap = "round";
    for (const [name, style] of Object.entries(STYLES)) {
      ctx.fillStyle = ctx.strokeStyle = palette[style.colour];
      for (const tile of tiles) {
        const content = this.tiles.find(tile)?.content;
        const path = content instanceof Map ? content.get(name) : undefined;
        if (!path) continue;
        ctx.lineWidth = (widthOf(style, this.#painted.scale) * this.#painted.ratio) / this.#place(tile, affine);
        if (style.least_px === undefined) ctx.fill(path);
        else ctx.stroke(path);
      }
    }
  }

  /** Let the canvas draw a tile from 0 to 1. Return the length of its edge in pixels. @param {TileId} tile @param {Affine} affine */
  #place({ z, x, y }, affine) {
    const { left, top, scale, ratio } = this.#painted;
    const [per_m, size] = [scale * ratio, 2 ** z];
    const [site_x, site_y] = siteAt(affine, x / size, y / size);
    const { a, b, c, d } = affine;
    this.#ctx.setTransform((per_m * a) / size, (-per_m * b) / size, (per_m * c) / size, (-per_m * d) / size, per_m * (site_x - left), per_m * (top - site_y));
    return (per_m * Math.hypot(a, b)) / size;
  }

  /** @param {CanvasRenderingContext2D} ctx @param {View} view @param {number} ratio */
  #show(ctx, view, ratio) {
    const { left, top, scale } = this.#painted;
    const factor = view.scale / scale;
    const whole = (/** @type {number} */ px) => (factor === 1 ? Math.round(px * ratio) / ratio : px); // stays sharp
    const [width, height] = [this.#canvas.width, this.#canvas.height].map((side) => (side / ratio) * factor);
    ctx.drawImage(this.#canvas, whole(view.screenX(left)), whole(view.screenY(top)), width, height);
  }
}
