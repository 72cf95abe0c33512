/** The destinations with the state of their queues, and the rules. */

import { requestChange } from "../data/access.js";
import { getJson } from "../data/connection.js";
import { Items } from "../data/items.js";
import { Refreshed } from "../data/refreshed.js";
import { shareToken } from "../data/shared.js";

/** @typedef {import("../data/items.js").Item} Item @typedef {import("./words.js").DestinationState} DestinationState */

/** Event: "change". */
export class AlertStore extends Refreshed {
  destinations = new Items("destinations", (answer) => answer.destination);
  rules = new Items("event-rules", (answer) => answer);
  /** @type {DestinationState[]} */
  states = [];
  /** @type {Item[]} */
  allRules = [];

  get paths() {
    return ["event-rules", ...(shareToken === null ? ["destinations"] : [])];
  }

  /** @param {any[]} answers without the destinations for a share link, which may not read them */
  take([rules, destinations]) {
    if (rules) this.allRules = rules.rules;
    if (destinations) this.states = destinations.destinations;
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
