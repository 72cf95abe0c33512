/** Read an answer with tracks beside the page, which would stand still meanwhile: it may be 30 MB. */

import { buffersOf, packed } from "./packed_tracks.js";

addEventListener("message", ({ data: { number, content } }) => {
  const all = packed(JSON.parse(new TextDecoder().decode(content)).tracks);
  /** @type {any} */ (self).postMessage({ number, all }, buffersOf(all));
});
