/** Show the base map by a picture that is a little larger than the view. While the map is moved, only this picture is drawn;
 * another one is painted when the view comes near its edge, at another scale, and when tiles arrive. */

import { standIns, tilesFor } from "./coverage.js";
import { affineAt } from "./mercator.js";
import { VECTOR } from "./tile_content.js";
import { keyOf } from "./tiles.js";

/** @typedef {import("../map/view.js").View} View @typedef {import("../map/palette.js").Palette} Palette */
/** @typedef {import("../plan/geodesy.js").Georeference} Georeference */
/** @typedef {{media_type: string} & import("./coverage.js").Extent} Description */
/** @typedef {import("../map/view.js").Bounds & {scale: number, ratio: number, look: string}} Frame of a picture */

/** Share of the view beyond each of its edges that a picture shows, and that must be left of it. */
const MARGIN = 0.25;
const LEFT_MARGIN = 0.08;
/** Factor of the scale at which a picture still looks well while the map is zoomed. */
const MAX_ZOOMED = 1.4;
const SETTLED_MS = 120;
/** Size at which tiles are shown, within a factor of √2: in pixels of the screen, and for vectors in those of the style sheet. */
const IMAGE_PX = 256;
const VECTOR_PX = 724; // 512 to 1024

export class Painter {
  /** For tests and the console: the last picture. */
  stats = { paintings: 0, ms: 0, zoom: -1, tiles: 0 };
  /** @type {{frame: Frame, picture: ImageBitmap} | null} */
  #shown = null;
  #isPainting = false;
  #settled = 0;
  #lastScale = 0;

  /** @param {import("./thread.js").PaintingThread} thread @param {import("./tiles.js").Tiles} tiles
   * @param {() => void} redraw draws the map again */
  constructor(thread, tiles, redraw) {
    this.thread = thread;
    this.tiles = tiles;
    this.redraw = redraw;
  }

  /** Return whether no picture is being painted. */
  get still() {
    return !this.#isPainting;
  }

  /** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {Description} description
   * @param {Georeference} origin */
  draw(ctx, view, palette, description, origin) {
    const ratio = ctx.canvas.width / view.width;
    const look = [this.tiles.version, themeOf(), origin.lat, origin.lon, origin.rotation_rad].join();
    if (!this.#isPainting && !this.#isGood(view, ratio, look)) this.#paint(frameOf(view, ratio, look), palette, description, origin);
    this.#show(ctx, view, ratio);
  }

  /** Return whether the picture still serves. A change of the scale waits until the map is no longer zoomed.
   * @param {View} view @param {number} ratio @param {string} look */
  #isGood(view, ratio, look) {
    const frame = this.#shown?.frame;
    if (!frame || look !== frame.look || ratio !== frame.ratio) return false;
    const seen = grown(view, LEFT_MARGIN);
    if (seen.left < frame.left || seen.right > frame.right || seen.bottom < frame.bottom || seen.top > frame.top) return false;
    if (view.scale === frame.scale) return true;
    const isZooming = view.scale !== this.#lastScale;
    this.#lastScale = view.scale;
    if (!isZooming || Math.abs(Math.log(view.scale / frame.scale)) > Math.log(MAX_ZOOMED)) return false;
    clearTimeout(this.#settled);
    this.#settled = setTimeout(this.redraw, SETTLED_MS);
    return true;
  }

  /** @param {Frame} frame @param {Palette} palette @param {Description} description @param {Georeference} origin */
  async #paint(frame, palette, description, origin) {
    const { left, right, bottom, top, scale, ratio } = frame;
    const affine = affineAt(origin, (left + right) / 2, (bottom + top) / 2);
    if (!affine) return;
    const isVector = description.media_type === VECTOR;
    const wanted = tilesFor(affine, frame, isVector ? scale : scale * ratio, isVector ? VECTOR_PX : IMAGE_PX, description);
    const { drawn, requested } = standIns(wanted, (tile) => this.tiles.find(tile), description.min_zoom, isVector);
    this.tiles.want(requested);
    const [width, height] = [right - left, top - bottom].map((side) => Math.ceil(side * scale * ratio));
    const colours = /** @type {Record<string, string>} */ (Object.fromEntries(Object.entries(palette).filter(([name]) => name === "map" || name.startsWith("base-"))));
    const tiles = drawn.map((tile) => ({ tile, key: keyOf(tile) }));
    const begun = performance.now();
    this.#isPainting = true;
    const picture = await this.thread.paint({ left, top, width, height, scale, ratio, affine, tiles, colours, isDark: themeOf() === "dark" });
    this.#isPainting = false;
    this.#shown?.picture.close();
    this.#shown = { frame, picture };
    this.stats = { paintings: this.stats.paintings + 1, ms: performance.now() - begun, zoom: drawn.at(-1)?.z ?? -1, tiles: drawn.length };
    this.redraw();
  }

  /** @param {CanvasRenderingContext2D} ctx @param {View} view @param {number} ratio */
  #show(ctx, view, ratio) {
    if (!this.#shown) return;
    const { frame: { left, top, scale, ratio: painted }, picture } = this.#shown;
    const factor = view.scale / scale;
    const whole = (/** @type {number} */ px) => (factor === 1 ? Math.round(px * ratio) / ratio : px); // stays sharp
    const [width, height] = [picture.width, picture.height].map((side) => (side / painted) * factor);
    ctx.drawImage(picture, whole(view.screenX(left)), whole(view.screenY(top)), width, height);
  }
}

const themeOf = () => document.documentElement.dataset.theme;

/** @param {View} view @param {number} ratio @param {string} look @returns {Frame} */
const frameOf = (view, ratio, look) => ({ ...grown(view, MARGIN), scale: view.scale, ratio, look });

/** Return the visible part of the site, and a share of it more on each side. @param {View} view @param {number} share */
function grown(view, share) {
  const { left, right, bottom, top } = view.bounds();
  const [across, up] = [share * (right - left), share * (top - bottom)];
  return { left: left - across, right: right + across, bottom: bottom - up, top: top + up };
}
