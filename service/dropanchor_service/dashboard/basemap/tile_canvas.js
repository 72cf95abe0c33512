/** Tiles that were read, and the canvas on which they are painted: in a thread of its own, or in the page. */

import { paint } from "./paint.js";
import { contentOf } from "./tile_content.js";

/** @typedef {{key: string, media_type: string, bytes: ArrayBuffer}} ReadRequest */

export class TileCanvas {
  /** @type {Map<string, import("./tile_content.js").Content>} */
  #contents = new Map();

  /** @param {OffscreenCanvas | HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
  }

  /** Keep a tile to be painted. Return whether it can be read. @param {ReadRequest} request */
  async read({ key, media_type, bytes }) {
    try {
      this.#contents.set(key, await contentOf(bytes, media_type));
      return true;
    } catch {
      return false;
    }
  }

  /** @param {import("./paint.js").Painting} painting @returns {Promise<ImageBitmap>} */
  async paint(painting) {
    paint(this.canvas, painting, (key) => this.#contents.get(key));
    return "transferToImageBitmap" in this.canvas ? this.canvas.transferToImageBitmap() : createImageBitmap(this.canvas);
  }

  /** @param {string} key */
  forget(key) {
    this.#contents.delete(key);
  }
}
