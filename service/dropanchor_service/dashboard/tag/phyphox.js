/** The experiment for the app phyphox: its link and its QR code. Both hold the key of the tag. */

import { ProblemError } from "../data/access.js";
import { ingest } from "./link.js";

/** Return the link that the app opens. @param {string} tag @param {string} key empty for a service without keys */
export function phyphoxLink(tag, key) {
  const query = new URLSearchParams(key ? { tag, token: key } : { tag });
  return ingest(`phyphox?${query}`).href.replace(/^https?:/, "phyphox:");
}

/** Return the QR code as the URL of an image. Throws an error with a sentence. @param {string} tag @param {string} key */
export async function phyphoxCode(tag, key) {
  const url = ingest(`phyphox/code?${new URLSearchParams({ tag })}`);
  const response = await fetch(url, key ? { headers: { Authorization: `Bearer ${key}` } } : {});
  if (!response.ok) throw new ProblemError(await response.json());
  return `data:image/svg+xml,${encodeURIComponent(await response.text())}`;
}
