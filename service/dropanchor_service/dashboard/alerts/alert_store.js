/** The destinations with the state of their queues, and the rules. */

import { requestChange } from "../data/access.js";
import { api, getJson } from "../data/connection.js";
import { Items } from "./items.js";

/** @typedef {import("./items.js").Item} Item @typedef {import("./words.js").DestinationState} DestinationState */

const PERIOD_MS = 3000;

/** Event: "change". */
export class AlertStore extends EventTarget {
  destinations = new Items("destinations", (answer) => answer.destination);
  rules = new Items("event-rules", (answer) => answer);
  /** @type {DestinationState[]} */
  states = [];
  /** @type {Item[]} */
  allRules = [];
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
    this.scope = await getJson(api("access")).then(({ scope }) => scope, () => "none");
    await this.#repeat();
  }

  stop() {
    clearTimeout(this.#timer);
    this.#timer = 0;
  }

  async #repeat() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#repeat(), PERIOD_MS);
    await this.refresh();
  }

  /** Request everything now. A failure leaves what was known: the page's connection says what is wrong. */
  async refresh() {
    const [destinations, rules] = await Promise.all(["destinations", "event-rules"].map((path) => getJson(api(path)).catch(() => null)));
    if (destinations) this.states = destinations.destinations;
    if (rules) this.allRules = rules.rules;
    this.dispatchEvent(new Event("change"));
  }

  /** Send a test event. Return what the receiver answered. @param {string} id @returns {Promise<{delivered: boolean, detail: string}>} */
  async test(id) {
    return (await requestChange(this.destinations.url(id, "/test"), "POST")).json();
  }

  /** Deliver the dead letters again, or forget them. @param {string} id @param {"retry" | "drop"} what */
  async settle(id, what) {
    if (what === "retry") await requestChange(this.destinations.url(id, "/dead-letters/retry"), "POST");
    else await requestChange(this.destinations.url(id, "/dead-letters"), "DELETE");
    await this.refresh();
  }

  /** Return the oldest dead letters. @param {string} id @returns {Promise<{event: import("../zones/words.js").ServiceEvent, reason: string}[]>} */
  async deadLetters(id) {
    return (await getJson(this.destinations.url(id, "/dead-letters"))).dead_letters;
  }
}
