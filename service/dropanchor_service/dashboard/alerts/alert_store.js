/** The destinations with the state of their queues, and the rules. */

import { requestChange } from "../data/access.js";
import { api, getJson } from "../data/connection.js";
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
  /** Why destinations of some types cannot be made, by their types. @type {Record<string, string>} */
  unavailable = {};
  /** @type {Record<string, import("../i18n/said.js").Phrase | null>} */
  unavailable_phrases = {};
  /** Networks inside whose machines may receive events. @type {{network: string, in_settings: boolean}[]} */
  networks = [];

  get paths() {
    return ["event-rules", ...(shareToken === null ? ["destinations", "receiver-networks"] : [])];
  }

  /** @param {any[]} answers without the destinations for a share link, which may not read them */
  take([rules, destinations, networks]) {
    if (rules) this.allRules = rules.rules;
    if (destinations) ({ destinations: this.states, unavailable: this.unavailable, unavailable_phrases: this.unavailable_phrases } = destinations);
    if (networks) this.networks = networks.networks;
  }

  /** Let the machines of a network receive events, or no longer. Throws Error with the sentence of the service.
   * @param {string} network @param {"PUT" | "DELETE"} method */
  async setNetwork(network, method) {
    await requestChange(api(`receiver-networks/${encodeURIComponent(network.trim())}`), method);
    await this.refresh();
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
