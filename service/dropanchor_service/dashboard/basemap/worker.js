/** Read and paint tiles in a thread of its own, so that neither delays the page. `thread.js` sends the messages. */

import { TileCanvas } from "./tile_canvas.js";

/** @typedef {{id: number, read?: import("./tile_canvas.js").ReadRequest, paint?: import("./paint.js").Painting, forget?: string}} Request forget: key of a tile, without an answer */

const tiles = new TileCanvas(new OffscreenCanvas(1, 1));

addEventListener("message", async ({ data }) => {
  const { id, read, paint, forget } = /** @type {Request} */ (data);
  if (forget !== undefined) tiles.forget(forget);
  if (read) postMessage({ id, answer: await tiles.read(read) });
  if (paint) {
    const answer = await tiles.paint(paint);
    postMessage({ id, answer }, { transfer: [answer] });
  }
});
