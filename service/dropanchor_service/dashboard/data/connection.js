/** The connection to the service: the stream of poses, and the site. It reconnects by itself. */

import { request, KeyRequiredError, StartingError } from "./access.js";
import { EpochFence } from "./epochs.js";
import { eventsOf } from "./events.js";
import { said } from "../i18n/said.js";

/** Frames per second; fewer for a large fleet, whose frames are large. */
const HZ = 10;
const HZ_OF_LARGE_FLEET = 4;
const LARGE_FLEET = 2000;
/** Least time between two requests for changed settings. */
const REFRESH_MS = 300;
const REFRESH_MS_PER_TAG = 5;
const RETRY_MS = [500, 1000, 2000, 3000];
const STARTING_MS = 1000;
const PROBE_MS = 3000;
const PROBE_TIMEOUT_MS = 4000;
/** Time in which the service begins to answer when it is asked for the stream. */
const STREAM_TIMEOUT_MS = 10_000;

/** The site that the page shows, of a service with several: `?site=` in its address; null: the only one. */
export const chosenSite = new URLSearchParams(globalThis.location?.search ?? "").get("site");
const SITE_PATH = chosenSite === null ? "" : `sites/${encodeURIComponent(chosenSite)}/`;

/** Return the URL of a path of this site, wherever the service is mounted. @param {string} path */
export const api = (path) => new URL(`api/v1/${SITE_PATH}${path}`, document.baseURI);

/** The URL of the list of sites. */
export const sitesUrl = () => new URL("api/v1/sites", document.baseURI);

/** @param {URL} url @returns {Promise<any>} */
export async function getJson(url) {
  return (await request(url, { signal: AbortSignal.timeout(PROBE_TIMEOUT_MS) })).json();
}

/**
 * Events: "snapshot" and "change" (detail: Frame), "site" (detail: Site), "settings" (some have changed), "status" (see
 * `status`).
 * The site is requested every few seconds, since its anchors may have moved and a silent stream may be dead.
 */
export class Connection extends EventTarget {
  /** "locked": the service requires a key, or another one. "starting": it answers, but is not ready yet.
   * @type {"connecting" | "starting" | "live" | "lost" | "locked"} */
  status = "connecting";
  /** What the service does while it is starting, in the language of the page. */
  progress = "";
  /** performance.now() at which the connection was lost. */
  lostAt = NaN;
  /** For tests and the console: number of frames so far, and the time that the last one took. */
  stats = { frames: 0, ms: 0 };
  #stream = new AbortController();
  #fence = new EpochFence();
  #attempt = 0;
  #max_hz = HZ;
  #timer = 0;
  #isOutdated = false;
  #refreshTimer = 0;
  #refresh_ms = REFRESH_MS;
  /** Numbers of requests for the site: the last one, and the last one that was answered. */
  #asked = 0;
  #answered = 0;

  start() {
    this.#open();
    this.#probe();
  }

  /** Try again now. */
  retry() {
    this.#attempt = 0;
    if (this.status === "locked") this.#become("connecting");
    this.#open();
  }

  /** @param {number} tags */
  slowDownFor(tags) {
    this.#refresh_ms = REFRESH_MS + REFRESH_MS_PER_TAG * tags;
    const max_hz = tags > LARGE_FLEET ? HZ_OF_LARGE_FLEET : HZ;
    if (max_hz === this.#max_hz) return;
    this.#max_hz = max_hz;
    this.#open();
  }

  #open() {
    clearTimeout(this.#timer);
    this.#stream.abort();
    this.#stream = new AbortController();
    this.#follow(this.#stream.signal);
  }

  /** @param {AbortSignal} signal */
  async #follow(signal) {
    const late = setTimeout(() => signal.aborted || this.#failed(), STREAM_TIMEOUT_MS);
    try {
      const response = await request(api(`stream?max_hz=${this.#max_hz}`), { signal }).finally(() => clearTimeout(late));
      this.#opened();
      for await (const { name, data } of eventsOf(response)) {
        if (name === "settings") this.refresh();
        else this.#dispatch(name === "snapshot" ? "snapshot" : "change", data);
      }
      this.#failed();
    } catch (error) {
      if (!signal.aborted) this.#failed(error);
    }
  }

  #opened() {
    this.#attempt = 0;
    this.#become("live");
  }

  /** @param {string} kind @param {string} data */
  #dispatch(kind, data) {
    const begun = performance.now();
    const frame = JSON.parse(data);
    this.#fence.check(frame); // otherwise the stream fails, and the page asks again for one of the owner
    this.dispatchEvent(new CustomEvent(kind, { detail: frame }));
    this.stats = { frames: this.stats.frames + 1, ms: performance.now() - begun };
  }

  /** @param {unknown} [why] */
  #failed(why) {
    this.#stream.abort();
    clearTimeout(this.#timer);
    if (why instanceof StartingError) {
      this.progress = said(why.message, why.problem.detail_phrase);
      this.#become("starting");
      this.#timer = setTimeout(() => this.#open(), STARTING_MS);
      return;
    }
    const locked = why instanceof KeyRequiredError;
    this.#become(locked ? "locked" : "lost");
    if (locked) return;
    this.#timer = setTimeout(() => this.#open(), RETRY_MS[Math.min(this.#attempt++, RETRY_MS.length - 1)]);
  }

  /** Request the site, since it or the settings of a tag have changed: now, but a burst of changes only now and then. */
  refresh() {
    this.#isOutdated = true;
    if (this.#refreshTimer === 0) this.#refreshWhileOutdated();
  }

  #refreshWhileOutdated() {
    this.#refreshTimer = 0;
    if (!this.#isOutdated) return;
    this.#isOutdated = false;
    this.#refreshTimer = setTimeout(() => this.#refreshWhileOutdated(), this.#refresh_ms);
    this.dispatchEvent(new Event("settings"));
    this.#requestSite();
  }

  async #requestSite() {
    const [asked, stream] = [++this.#asked, this.#stream];
    try {
      if (this.status === "locked") return;
      const site = await getJson(api("site"));
      if (asked < this.#answered) return; // a later answer has overtaken this one
      this.#answered = asked;
      this.dispatchEvent(new CustomEvent("site", { detail: site }));
    } catch (error) {
      if (this.status === "live" && stream === this.#stream) this.#failed(error); // else it was asked with another key
    }
  }

  async #probe() {
    await this.#requestSite();
    setTimeout(() => this.#probe(), PROBE_MS);
  }

  /** @param {Connection["status"]} status */
  #become(status) {
    if (status === this.status) return;
    if (status === "lost") this.lostAt = performance.now();
    this.status = status;
    this.dispatchEvent(new Event("status"));
  }
}
