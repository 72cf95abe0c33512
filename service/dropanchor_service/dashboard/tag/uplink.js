/** The connection that takes the messages of the queue to the service. It reconnects by itself. */

import { stamp } from "./packed.js";
import { t } from "../i18n/language.js";
import { endOf } from "../i18n/said.js";

const PROTOCOL = "dropanchor.samples";
const KEY_PROTOCOL = "dropanchor.key.";
const MAX_IN_FLIGHT = 64;
const RETRY_MS = [500, 1000, 2000, 3000];
/** A connection without an answer for this long is dead: nothing else says so when the network is gone. */
const SILENT_MS = 5000;
/** Codes with which the service refuses this key or tag: to try again is of no use. */
const REFUSED = new Set([4400, 4401, 4403]);

/**
 * @typedef {object} Answer
 * @property {number} message
 * @property {string | null} rejected
 * @property {string} detail
 * @property {number} t_ns
 * @property {number} started_ns
 * @property {string | null} state
 * @property {string} hint
 * @property {import("../i18n/said.js").Phrase | null} hint_phrase
 */

export class Uplink {
  /** @type {"closed" | "connecting" | "open" | "broken" | "refused"} */
  status = "closed";
  /** Why the service refused, or did not understand a message, in the language of the page. */
  problem = "";
  /** Samples that the service has answered. */
  sent = 0;
  /** The last answer; null before one. @type {Answer | null} */
  answer = null;
  #socket = /** @type {WebSocket | null} */ (null);
  #sent_us = /** @type {number[]} */ ([]);
  #heard_ms = 0;
  #attempt = 0;
  #timer = 0;
  #started_ns = 0;

  /**
   * @param {URL} url @param {string} key empty for a service without keys
   * @param {import("./queue.js").Queue} queue @param {import("./clock.js").Clock} clock
   */
  constructor(url, key, queue, clock) {
    this.url = url;
    this.key = key;
    this.queue = queue;
    this.clock = clock;
    addEventListener("online", () => this.status === "broken" && this.open());
  }

  open() {
    clearTimeout(this.#timer);
    this.#drop();
    this.status = "connecting";
    const protocols = this.key ? [PROTOCOL, KEY_PROTOCOL + this.key] : [PROTOCOL];
    try {
      this.#socket = new WebSocket(this.url, protocols);
    } catch {
      this.#refuse(t("phone.bad_key"));
      return;
    }
    const socket = this.#socket;
    this.#heard_ms = performance.now();
    socket.onmessage = ({ data }) => this.#heard(JSON.parse(data));
    socket.onclose = ({ code, reason }) => socket === this.#socket && this.#ended(code, reason);
  }

  /** Send what waits, as far as answers keep up. Call it several times a second. */
  send() {
    const isSilent = performance.now() - this.#heard_ms > SILENT_MS;
    if (isSilent && (this.status === "connecting" || this.queue.inFlight)) this.#ended(0, "");
    if (this.status !== "open" || this.#socket === null) return;
    while (this.queue.inFlight < MAX_IN_FLIGHT) {
      if (!this.queue.inFlight) this.#heard_ms = performance.now();
      const message = this.queue.next();
      if (message === undefined) return;
      stamp(message.bytes, message.t0_us + this.clock.correction_us);
      this.#sent_us.push(this.clock.local_us());
      this.#socket.send(/** @type {Uint8Array<ArrayBuffer>} */ (message.bytes));
    }
  }

  close() {
    clearTimeout(this.#timer);
    this.#drop();
    this.status = "closed";
  }

  /** @param {Answer} answer */
  #heard(answer) {
    this.#heard_ms = performance.now();
    this.#attempt = 0;
    this.answer = answer;
    if (answer.message === 0) this.#greeted(answer);
    else this.#answered(answer);
    this.send();
  }

  /** @param {Answer} answer */
  #greeted({ started_ns }) {
    if (this.#started_ns && started_ns !== this.#started_ns) this.sent -= this.queue.restore();
    this.#started_ns = started_ns;
    this.status = "open";
    this.problem = "";
  }

  /** @param {Answer} answer */
  #answered({ t_ns, rejected, detail }) {
    this.clock.note(/** @type {number} */ (this.#sent_us.shift()), t_ns / 1000);
    const { samples } = this.queue.answered();
    if (rejected === null) this.sent += samples;
    else this.problem = t("phone.not_understood", { detail });
  }

  /** @param {number} code @param {string} reason */
  #ended(code, reason) {
    this.#drop();
    if (REFUSED.has(code)) {
      this.#refuse(endOf(reason));
      return;
    }
    this.status = "broken";
    this.problem = endOf(reason);
    this.#timer = setTimeout(() => this.open(), RETRY_MS[Math.min(this.#attempt++, RETRY_MS.length - 1)]);
  }

  /** @param {string} why */
  #refuse(why) {
    this.status = "refused";
    this.problem = why;
  }

  #drop() {
    const socket = this.#socket;
    this.#socket = null;
    if (socket !== null) socket.onmessage = socket.onclose = null;
    socket?.close();
    this.#sent_us = [];
    this.queue.again();
  }
}
