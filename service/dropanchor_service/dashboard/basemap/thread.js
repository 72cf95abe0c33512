/** The thread that reads and paints tiles, as the page sees it: `worker.js` runs in it. */

export class PaintingThread {
  /** Runs from the first request on, so that a page without a base map has none. @type {Worker | null} */
  #worker = null;
  /** @type {Map<number, (answer: any) => void>} */
  #waiting = new Map();
  #id = 0;

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
  }

  /** @param {object} request @param {Transferable[]} transfer @returns {Promise<any>} */
  #ask(request, transfer) {
    const id = ++this.#id;
    this.#worker ??= this.#started();
    this.#worker.postMessage({ id, ...request }, transfer);
    return new Promise((resolve) => this.#waiting.set(id, resolve));
  }

  #started() {
    const worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
    worker.addEventListener("message", ({ data: { id, answer } }) => {
      this.#waiting.get(id)?.(answer);
      this.#waiting.delete(id);
    });
    return worker;
  }
}
