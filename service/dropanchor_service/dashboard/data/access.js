/** Requests to the service, with a key where it requires one. The key lives in this browser tab until the tab closes. */

const STORAGE_KEY = "dropanchor.key";

export class KeyRequiredError extends Error {}

/** The service answers, but is still starting. The message says what it does. */
export class StartingError extends Error {}

const UNAVAILABLE = 503;
const NOT_READY = "urn:dropanchor:problem:not-ready";

export const hasKey = () => sessionStorage.getItem(STORAGE_KEY) !== null;

/** @param {string} key */
export const storeKey = (key) => sessionStorage.setItem(STORAGE_KEY, key);

/**
 * Return a successful response. Throws KeyRequiredError without a valid key, StartingError while the service starts, and
 * Error for any other failure.
 * @param {URL} url @param {RequestInit} options @returns {Promise<Response>}
 */
export async function request(url, options) {
  const response = await fetch(url, { ...options, headers: authorization(), cache: "no-store" });
  if (response.status === 401 || response.status === 403) throw new KeyRequiredError(`${url.pathname} requires another key`);
  if (response.status === UNAVAILABLE) {
    const problem = await response.json();
    if (problem.type === NOT_READY) throw new StartingError(problem.detail);
  }
  if (!response.ok) throw new Error(`${url.pathname} returned status ${response.status}`);
  return response;
}

/**
 * Send a change as JSON. Throws Error with the sentence of the service when it refuses the change.
 * @param {URL} url @param {"PUT" | "POST" | "DELETE"} method @param {object} body
 */
export async function sendJson(url, method, body) {
  const headers = { ...authorization(), "content-type": "application/json" };
  const response = await fetch(url, { method, headers, body: JSON.stringify(body), cache: "no-store" });
  if (!response.ok) throw new Error((await response.json()).detail);
}

/** @returns {Record<string, string>} */
function authorization() {
  const key = sessionStorage.getItem(STORAGE_KEY);
  return key === null ? {} : { authorization: `Bearer ${key}` };
}
