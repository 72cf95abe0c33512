/** The address at which a phone reaches this page, and its QR code. */

import { send } from "./access.js";
import { api, getJson } from "./connection.js";

/** @typedef {{simulate: string, credentials: boolean, pages: string[], may_simulate: boolean}} Connect as in the interface */

/** @returns {Promise<Connect>} */
export const readConnect = () => getJson(api("connect"));

/** Return the address of a page of the service for another device; null: none can reach it.
 * @param {string} path @param {readonly string[]} pages the addresses of the service in its networks */
export function forOthers(path, pages) {
  const own = new URL(path, document.baseURI);
  if (!isOfThisMachine(own.hostname)) return own.href;
  if (pages.length === 0) return null;
  return new URL(own.pathname.slice(1) + own.search, pages[0]).href;
}

/** @param {string} host */
const isOfThisMachine = (host) => host === "localhost" || host === "[::1]" || /^127\./.test(host);

/** Draw the QR code of a link. @param {HTMLImageElement} image @param {string} link */
export async function drawCode(image, link) {
  const svg = await (await send(api("qr-code"), "POST", { text: link })).text();
  image.src = `data:image/svg+xml,${encodeURIComponent(svg)}`;
  image.hidden = false;
}
