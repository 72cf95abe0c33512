/** Read and paint tiles in a thread of its own, so that neither delays the page. `thread.js` sends the messages. */

import { paint } from "./paint.js";
import { contentOf } from "./tile_content.js";

/** @typedef {{key: string, media_type: string, bytes: ArrayBuffer}} ReadRequest */
/** @typedef {{id: number, read?: ReadRequest, paint?: import("./paint.js").Painting, forget?: string}} Request forget: key of a tile, without an answer */

/** @type {Map<string, import("./tile_content.js").Content>} */
const contents = new Map();
const canvas = new OffscreenCanvas(1, 1);

addEventListener("message", async ({ data }) => {
  const { id, read, paint: painting, forget } = /** @type {Request} */ (data);
  if (forget !== undefined) contents.delete(forget);
  if (read) postMessage({ id, answer: await isRead(read) });
  if (painting) {
    paint(canvas, painting, (key) => contents.get(key));
    const answer = canvas.transferToImageBitmap();
    postMessage({ id, answer }, { transfer: [answer] });
  }
});

/** Return whether a tile can be read. @param {ReadRequest} request */
async function isRead({ key, media_type, bytes }) {
  try {
    contents.set(key, await contentOf(bytes, media_type));
    return true;
  } catch {
    return false;
  }
}
