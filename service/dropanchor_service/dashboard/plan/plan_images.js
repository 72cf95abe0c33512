/** The images of plans, ready to be drawn: in halving sizes, so that a large one costs little when it is small on the map. */

import { request } from "../data/access.js";
import { api } from "../data/connection.js";

/** @typedef {import("./plan_store.js").PlanImage} PlanImage */

const MAX_SIDE_PX = 4096;
const MIN_SIDE_PX = 256;
const RETRY_MS = 5000;

/** Event: "change", when an image has arrived or is worth another request. */
export class PlanImages extends EventTarget {
  /** By id and look; empty while the image is on its way. @type {Map<string, HTMLCanvasElement[]>} */
  #levels = new Map();

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
  }

  /** @param {string} key @param {PlanImage} image @param {boolean} inverted */
  async #load(key, image, inverted) {
    this.#levels.set(key, []);
    try {
      const blob = await (await request(api(`plan-images/${image.id}`), { cache: "force-cache" })).blob();
      const source = image.media_type === "image/svg+xml" ? await loaded(blob) : await createImageBitmap(blob);
      const levels = halved(drawn(source, sizeOf(image), inverted));
      if (this.#levels.has(key)) this.#levels.set(key, levels);
    } catch {
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS)); // the connection of the page says what is wrong
      this.#levels.delete(key);
    }
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}

/** Return an SVG that an earlier version has stored. Scripts never run in an image, whatever it contains. @param {Blob} blob */
async function loaded(blob) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(await blob.text())}`;
  await image.decode();
  return image;
}

/** Return the size in which an image is kept. @param {PlanImage} image */
function sizeOf({ width_px, height_px }) {
  const scale = Math.min(1, MAX_SIDE_PX / Math.max(width_px, height_px));
  return { width: width_px * scale, height: height_px * scale };
}

/** @param {CanvasImageSource} source @param {{width: number, height: number}} size @param {boolean} inverted */
function drawn(source, { width, height }, inverted) {
  const canvas = scaled(source, width, height);
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

/** @param {CanvasImageSource} source @param {number} width @param {number} height */
function scaled(source, width, height) {
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(width));
  canvas.height = Math.max(1, Math.round(height));
  const ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  ctx.imageSmoothingQuality = "high";
  ctx.drawImage(source, 0, 0, canvas.width, canvas.height);
  return canvas;
}
