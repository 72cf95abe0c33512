/** Asks the service, with a key where it wants one. The key is kept by this tab alone, until the tab is closed. */

const KEPT = "dropanchor.key";

export class KeyWantedError extends Error {}

export const hasKey = () => sessionStorage.getItem(KEPT) !== null;

/** @param {string} key */
export const keepKey = (key) => sessionStorage.setItem(KEPT, key);

/**
 * An answer that is a good one; throws otherwise.
 * @param {URL} url @param {RequestInit} options @returns {Promise<Response>}
 */
export async function ask(url, options) {
  const key = sessionStorage.getItem(KEPT);
  const headers = key === null ? {} : { authorization: `Bearer ${key}` };
  const answer = await fetch(url, { ...options, headers, cache: "no-store" });
  if (answer.status === 401 || answer.status === 403) throw new KeyWantedError(`${url.pathname} wants another key`);
  if (!answer.ok) throw new Error(`${url.pathname} answered ${answer.status}`);
  return answer;
}
