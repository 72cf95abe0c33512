/** Save an answer of the service as a file. A link could not carry a key. */

import { request } from "./access.js";

/** @param {URL} url @param {string} name of the file */
export async function saveFile(url, name) {
  saveContent(await (await request(url, {})).blob(), name);
}

/** @param {Blob} content @param {string} name of the file */
export function saveContent(content, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
