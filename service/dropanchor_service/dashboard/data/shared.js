/** The share link with which the page was opened: its token stands in the address (`share=`) and works like a key. */

import { addressValues } from "./address.js";

const PREFIX = "dropanchor_share_";

/** @typedef {{exp: number, tag: string | null, group: string | null}} Claims exp: Unix time */

/** The token; null: the page was not opened with a share link. */
export const shareToken = addressValues().get("share");

/** What the link says of itself; null when it is damaged. The service checks its signature. */
export const shareClaims = shareToken === null ? null : claimsOf(shareToken);

/** Whether the link shows one tag or one group only. */
export const isLimited = shareClaims !== null && (shareClaims.tag !== null || shareClaims.group !== null);

/** @param {string} token @returns {Claims | null} */
export function claimsOf(token) {
  try {
    const [, payload] = token.slice(PREFIX.length).split(".");
    const bytes = Uint8Array.from(atob(payload.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
    return JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    return null;
  }
}
