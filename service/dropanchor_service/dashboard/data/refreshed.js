/** What a panel shows: requested again and again, with what the key of this page allows. */

import { api, getJson } from "./connection.js";

const PERIOD_MS = 3000;

/** Base class. Event: "change". */
export class Refreshed extends EventTarget {
  /** @type {"none" | "read" | "write" | "admin"} */
  scope = "none";
  #timer = 0;

  get mayWrite() {
    return this.scope === "write" || this.scope === "admin";
  }

  get isAdmin() {
    return this.scope === "admin";
  }

  /** Request everything now and every few seconds, until `stop`. */
  async start() {
    this.stop();
    this.scope = "none";
    await this.#repeat();
  }

  stop() {
    clearTimeout(this.#timer);
    this.#timer = 0;
  }

  /** Request everything now. A failure leaves what was known: the page's connection says what is wrong. */
  async refresh() {
    this.take(await Promise.all(this.paths.map((path) => getJson(api(path)).catch(() => null))));
    this.dispatchEvent(new Event("change"));
  }

  /** What to request. @returns {string[]} */
  get paths() {
    throw new Error("a class derived from Refreshed says what to request");
  }

  /** Keep the answers, in the order of the paths. @param {any[]} _answers each null when its request failed */
  take(_answers) {}

  async #repeat() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#repeat(), PERIOD_MS);
    if (this.scope === "none") this.scope = await getJson(api("access")).then(({ scope }) => scope, () => "none");
    await this.refresh();
  }
}
