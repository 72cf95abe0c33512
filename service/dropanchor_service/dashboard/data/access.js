/** Requests to the service, with a key where it requires one. The key lives in this browser tab until the tab closes.
 * The token of a share link takes its place. */

import { shareToken } from "./shared.js";

const STORAGE_KEY = "dropanchor.key";

export class KeyRequiredError extends Error {}

/** The service cannot do this as it is. */
export class RefusedError extends Error {}

/** The service refuses something, and says why. */
export class ProblemError extends Error {
  /** @param {import("../i18n/said.js").Problem} problem */
  constructor(problem) {
    super(problem.detail);
    this.problem = problem;
  }
}

/** The service answers, but is still starting. The problem says what it does. */
export class StartingError extends ProblemError {}

const CONFLICT = 409;
const UNAVAILABLE = 503;
const CHANGED_MEANWHILE = 412;
const NOT_READY = "urn:dropanchor:problem:not-ready";

export const hasKey = () => keyOf() !== null;

/** @returns {string | null} */
const keyOf = () => shareToken ?? sessionStorage.getItem(STORAGE_KEY);

/** @param {string} key */
export const storeKey = (key) => sessionStorage.setItem(STORAGE_KEY, key);

/**
 * Return a successful response. Throws KeyRequiredError without a valid key, StartingError while the service starts,
 * RefusedError when it cannot do this as it is, and Error for any other failure.
 * @param {URL} url @param {RequestInit} options @returns {Promise<Response>}
 */
export async function request(url, options) {
  const response = await fetch(url, { cache: "no-store", ...options, headers: authorization() });
  if (response.status === 401 || response.status === 403) throw new KeyRequiredError(`${url.pathname} requires another key`);
  if (response.status === UNAVAILABLE) {
    const problem = await response.json();
    if (problem.type === NOT_READY) throw new StartingError(problem);
  }
  if (response.status === CONFLICT) throw new RefusedError(`${url.pathname} is refused`);
  if (!response.ok) throw new Error(`${url.pathname} returned status ${response.status}`);
  return response;
}

/** The service does not answer. */
export class UnreachableError extends Error {}

/** Somebody changed the resource since this page has read it. */
export class ChangedMeanwhileError extends ProblemError {}

/** A receiver lies inside, in a network that an administrator can allow. */
export class NetworkRefusedError extends ProblemError {
  get network() {
    return /** @type {string} */ (this.problem.network);
  }
}

/**
 * Send a change. Return the ETag of the new resource, empty after a deletion. Throws ChangedMeanwhileError when the
 * conditions are not met, and ProblemError when the service refuses the change.
 * @param {URL} url @param {"PUT" | "DELETE"} method @param {object | null} body
 * @param {Record<string, string>} conditions headers
 */
export async function sendChange(url, method, body, conditions) {
  return (await send(url, method, body, conditions)).headers.get("etag") ?? "";
}

/** Send a request with a body. Throws as `sendChange` does. @param {URL} url @param {"POST" | "PUT" | "DELETE"} method
 * @param {object | null} body @param {Record<string, string>} [conditions] headers */
export async function send(url, method, body, conditions = {}) {
  const headers = { ...authorization(), ...conditions, "content-type": "application/json" };
  const response = await answerTo(url, { method, headers, body: body && JSON.stringify(body) });
  if (response.ok) return response;
  const problem = await response.json();
  if (problem.network) throw new NetworkRefusedError(problem);
  throw response.status === CHANGED_MEANWHILE ? new ChangedMeanwhileError(problem) : new ProblemError(problem);
}

/** Send a file. Return the answer. Throws ProblemError when the service refuses the file.
 * @param {URL} url @param {File} file @returns {Promise<any>} */
export async function upload(url, file) {
  const headers = { ...authorization(), "content-type": file.type || "application/octet-stream" };
  const response = await answerTo(url, { method: "POST", headers, body: file });
  const answer = await response.json();
  if (!response.ok) throw new ProblemError(answer);
  return answer;
}

/**
 * Ask for an action that has no body. Return the response. Throws ProblemError when the service refuses.
 * @param {URL} url @param {"POST" | "PUT" | "DELETE"} method
 */
export async function requestChange(url, method) {
  const response = await answerTo(url, { method, headers: authorization() });
  if (response.ok) return response;
  throw new ProblemError(await response.json());
}

/** Return the response to a change. Throws UnreachableError when the service does not answer. A deletion goes on when the page is closed meanwhile.
 * @param {URL} url @param {RequestInit} options */
async function answerTo(url, options) {
  try {
    return await fetch(url, { ...options, cache: "no-store", keepalive: options.method === "DELETE" });
  } catch {
    throw new UnreachableError("The service cannot be reached.");
  }
}

/** @returns {Record<string, string>} */
function authorization() {
  const key = keyOf();
  return key === null ? {} : { authorization: `Bearer ${key}` };
}
