/** The images of plans, ready to be drawn: in halving sizes, so that a large one costs little when it is small on the map. */

import { request } from "../data/access.js";
import { api } from "../data/connection.js";
import { TooSlowError, drawnInTime, inTime } from "./patience.js";

/** @typedef {import("./plan_store.js").PlanImage} PlanImage */

const MAX_SIDE_PX = 4096;
const MIN_SIDE_PX = 256;
const RETRY_MS = 5000;

/** Event: "change", when an image has arrived or is worth another request. */
export class PlanImages extends EventTarget {
  /** By id and look; empty while the image is on its way. @type {Map<string, HTMLCanvasElement[]>} */
  #levels = new Map();

  /** Why images are not shown, or not in full: "slow" or "coarse", by id. @type {Map<string, "slow" | "coarse">} */
  #faults = new Map();

  /** Return what is wrong with the drawing of an image, or undefined. @param {PlanImage} image */
  faultOf = (image) => this.#faults.get(image.id);

  /** Return the sizes of an image, the largest first; empty until it has arrived. @param {PlanImage} image @param {boolean} inverted */
  of(image, inverted) {
    const key = `${image.id} ${inverted}`;
    const levels = this.#levels.get(key);
    if (!levels) this.#load(key, image, inverted);
    return levels ?? [];
  }

  /** Return whether an image has arrived. @param {PlanImage} image */
  isReady(image) {
    return [true, false].some((inverted) => (this.#levels.get(`${image.id} ${inverted}`) ?? []).length > 0);
  }

  /** Forget all images but these. @param {readonly PlanImage[]} images */
  keep(images) {
    const ids = new Set(images.map(({ id }) => id));
    for (const key of this.#levels.keys()) if (!ids.has(key.split(" ")[0])) this.#levels.delete(key);
    for (const id of this.#faults.keys()) if (!ids.has(id)) this.#faults.delete(id);
  }

  /** @param {string} key @param {PlanImage} image @param {boolean} inverted */
  async #load(key, image, inverted) {
    this.#levels.set(key, []);
    try {
      const blob = await (await request(api(`plan-images/${image.id}`), { cache: "force-cache" })).blob();
      const isDrawing = image.media_type === "image/svg+xml"; // the service has bounded the pixels of all others
      const largest = isDrawing ? await this.#drawing(await inTime(loaded(blob)), image, inverted) : drawn(await createImageBitmap(blob), sizeOf(image), inverted);
      const levels = halved(largest);
      if (this.#levels.has(key)) this.#levels.set(key, levels);
    } catch (error) {
      if (error instanceof TooSlowError) this.#faults.set(image.id, "slow"); // its levels stay empty, so it is not tried again
      if (error instanceof TooSlowError) return this.#changed();
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS)); // the connection of the page says what is wrong
      this.#levels.delete(key);
    }
    this.#changed();
  }

  /** Return an SVG at the largest size that is drawn in time. Rejects with TooSlowError. @param {HTMLImageElement} source @param {PlanImage} image @param {boolean} inverted */
  async #drawing(source, { id, width_px, height_px }, inverted) {
    const longer = Math.max(width_px, height_px);
    const found = await drawnInTime(MAX_SIDE_PX, (side) => drawnNow(source, { width: (width_px * side) / longer, height: (height_px * side) / longer }, inverted));
    if (found === null) throw new TooSlowError();
    if (!found.isWhole) this.#faults.set(id, "coarse");
    return found.drawing;
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}

/** Return an SVG that can be drawn. Scripts never run in an image, whatever it contains. @param {Blob} blob */
async function loaded(blob) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(await blob.text())}`;
  await image.decode();
  return image;
}

/** Return the size in which a raster image is kept. Only an SVG gains by more pixels. @param {PlanImage} image */
function sizeOf({ width_px, height_px }) {
  const scale = Math.min(1, MAX_SIDE_PX / Math.max(width_px, height_px));
  return { width: width_px * scale, height: height_px * scale };
}

/** Return a drawing whose pixels are there: a canvas may put its work off otherwise. @param {CanvasImageSource} source
 * @param {{width: number, height: number}} size @param {boolean} inverted */
function drawnNow(source, size, inverted) {
  const canvas = drawn(source, size, inverted, { willReadFrequently: true });
  /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")).getImageData(0, 0, 1, 1);
  return canvas;
}

/** @param {CanvasImageSource} source @param {{width: number, height: number}} size @param {boolean} inverted @param {CanvasRenderingContext2DSettings} [how] */
function drawn(source, { width, height }, inverted, how) {
  const canvas = scaled(source, width, height, how);
  if (!inverted) return canvas;
  const ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  ctx.globalCompositeOperation = "difference";
  ctx.fillStyle = "#fff";
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.globalCompositeOperation = "destination-in"; // transparent pixels stay transparent
  ctx.drawImage(source, 0, 0, canvas.width, canvas.height);
  return canvas;
}

/** @param {HTMLCanvasElement} largest */
function halved(largest) {
  const levels = [largest];
  for (let last = largest; Math.max(last.width, last.height) > MIN_SIDE_PX; levels.push(last)) last = scaled(last, last.width / 2, last.height / 2);
  return levels;
}

/** @param {CanvasImageSource} source @param {number} width @param {number} height @param {CanvasRenderingContext2DSettings} [how] */
function scaled(source, width, height, how) {
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(width));
  canvas.height = Math.max(1, Math.round(height));
  const ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", how));
  ctx.imageSmoothingQuality = "high";
  ctx.drawImage(source, 0, 0, canvas.width, canvas.height);
  return canvas;
}
