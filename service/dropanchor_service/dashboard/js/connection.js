/** The service: the stream of poses, and the site. Comes back by itself when the service does. */

/** Frames a second; fewer where each is large. */
const HZ = 10;
const HZ_OF_MANY = 4;
const MANY = 2000;
const RETRY_MS = [500, 1000, 2000, 3000];
const PROBE_MS = 3000;
const PROBE_TIMEOUT_MS = 4000;

/** Below the root of the service, wherever that is mounted. @param {string} path */
export const api = (path) => new URL(`api/v1/${path}`, document.baseURI);

/** @param {URL} url @returns {Promise<any>} */
export async function getJson(url) {
  const answer = await fetch(url, { signal: AbortSignal.timeout(PROBE_TIMEOUT_MS), cache: "no-store" });
  if (!answer.ok) throw new Error(`${url.pathname} answered ${answer.status}`);
  return answer.json();
}

/**
 * Events: "snapshot" and "change" (detail: Frame), "site" (detail: Site), "status" (see `status`).
 * The site is asked for every few seconds: its anchors may have been moved, and a silent stream may be a dead one.
 */
export class Connection extends EventTarget {
  /** @type {"connecting" | "live" | "lost"} */
  status = "connecting";
  /** performance.now() at which the connection was lost. */
  lostAt = NaN;
  /** For tests and the curious: frames so far, and what the last one cost. */
  stats = { frames: 0, ms: 0 };
  /** @type {EventSource | null} */
  #stream = null;
  #attempt = 0;
  #max_hz = HZ;
  #timer = 0;

  start() {
    this.#open();
    this.#probe();
  }

  /** Try again now. */
  retry() {
    this.#attempt = 0;
    this.#open();
  }

  /** @param {number} tags */
  slowDownFor(tags) {
    const max_hz = tags > MANY ? HZ_OF_MANY : HZ;
    if (max_hz === this.#max_hz) return;
    this.#max_hz = max_hz;
    this.#open();
  }

  #open() {
    clearTimeout(this.#timer);
    this.#stream?.close();
    const stream = new EventSource(api(`stream?max_hz=${this.#max_hz}`));
    stream.addEventListener("open", () => this.#opened());
    stream.addEventListener("snapshot", (event) => this.#received("snapshot", event));
    stream.addEventListener("poses", (event) => this.#received("change", event));
    stream.addEventListener("error", () => this.#failed());
    this.#stream = stream;
  }

  #opened() {
    this.#attempt = 0;
    this.#become("live");
  }

  /** @param {string} kind @param {MessageEvent} event */
  #received(kind, event) {
    const begun = performance.now();
    this.dispatchEvent(new CustomEvent(kind, { detail: JSON.parse(event.data) }));
    this.stats = { frames: this.stats.frames + 1, ms: performance.now() - begun };
  }

  #failed() {
    this.#stream?.close();
    this.#become("lost");
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#open(), RETRY_MS[Math.min(this.#attempt++, RETRY_MS.length - 1)]);
  }

  async #probe() {
    try {
      this.dispatchEvent(new CustomEvent("site", { detail: await getJson(api("site")) }));
    } catch {
      if (this.status === "live") this.#failed();
    }
    setTimeout(() => this.#probe(), PROBE_MS);
  }

  /** @param {"connecting" | "live" | "lost"} status */
  #become(status) {
    if (status === this.status) return;
    if (status === "lost") this.lostAt = performance.now();
    this.status = status;
    this.dispatchEvent(new Event("status"));
  }
}
