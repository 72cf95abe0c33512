/** The thread that reads and paints tiles, as the page sees it: `worker.js` runs in it. A browser that cannot paint in a
 * thread (before 2023, most could not) paints in the page: then moving the map to another place stalls for a moment. */

import { TileCanvas } from "./tile_canvas.js";

/** @typedef {{read?: import("./tile_canvas.js").ReadRequest, paint?: import("./paint.js").Painting}} Request */

export class PaintingThread {
  /** Runs from the first request on, so that a page without a base map has none. @type {Worker | null} */
  #worker = null;
  /** Paints in the page. @type {TileCanvas | null} */
  #here = null;
  /** @type {Map<number, {request: Request, resolve: (answer: any) => void}>} */
  #waiting = new Map();
  #id = 0;
  #hasAnswered = false;

  /** Return whether a tile can be read, and keep it to be painted.
   * @param {string} key @param {string} media_type @param {ArrayBuffer} bytes @returns {Promise<boolean>} */
  read(key, media_type, bytes) {
    return this.#ask({ read: { key, media_type, bytes } }, [bytes]);
  }

  /** @param {import("./paint.js").Painting} painting @returns {Promise<ImageBitmap>} */
  paint(painting) {
    return this.#ask({ paint: painting }, []);
  }

  /** @param {string} key */
  forget(key) {
    this.#worker?.postMessage({ id: 0, forget: key });
    this.#here?.forget(key);
  }

  /** @param {Request} request @param {Transferable[]} transfer @returns {Promise<any>} */
  #ask(request, transfer) {
    this.#start();
    if (this.#here) return answerOf(this.#here, request);
    const id = ++this.#id;
    this.#worker?.postMessage({ id, ...request }, transfer);
    return new Promise((resolve) => this.#waiting.set(id, { request, resolve }));
  }

  #start() {
    if (this.#worker || this.#here) return;
    if (typeof OffscreenCanvas === "undefined") return this.#paintHere();
    this.#worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
    this.#worker.addEventListener("error", () => !this.#hasAnswered && this.#paintHere()); // some run no modules in threads
    this.#worker.addEventListener("message", ({ data: { id, answer } }) => {
      this.#hasAnswered = true;
      this.#waiting.get(id)?.resolve(answer);
      this.#waiting.delete(id);
    });
  }

  /** The bytes of tiles that the thread has are lost: they count as unreadable, and are requested again. */
  #paintHere() {
    this.#worker?.terminate();
    [this.#worker, this.#here] = [null, new TileCanvas(document.createElement("canvas"))];
    for (const { request, resolve } of this.#waiting.values()) resolve(request.read ? false : answerOf(this.#here, request));
    this.#waiting.clear();
  }
}

/** @param {TileCanvas} canvas @param {Request} request @returns {Promise<any>} */
async function answerOf(canvas, { read, paint }) {
  return read ? canvas.read(read) : paint && canvas.paint(paint);
}
