/** What is wrong now: the alarms that are open, and those that are over and that nobody has acknowledged. */

import { send } from "../data/access.js";
import { api } from "../data/connection.js";
import { Refreshed } from "../data/refreshed.js";

/**
 * @typedef {object} Alarm as in the interface
 * @property {string} id
 * @property {"warning" | "alarm"} severity
 * @property {number} began_ns
 * @property {number | null} over_ns
 * @property {{by: {source: string, name: string}, t_ns: number, note: string} | null} acknowledged
 * @property {number | null} muted_until_ns
 * @property {import("../zones/words.js").ServiceEvent} event what began it
 */

/** How bad it is that a tag has an alarm of a severity. */
const RANK = { warning: 1, alarm: 2 };

/** Event: "change". */
export class AlarmStore extends Refreshed {
  /** Newest first. @type {readonly Alarm[]} */
  all = [];
  /** The worst severity of the open alarms of each tag that has any, but for muted ones. @type {ReadonlyMap<string, "warning" | "alarm">} */
  tags = new Map();

  get paths() {
    return ["alarms?limit=1000"];
  }

  /** @param {any[]} answers */
  take([answer]) {
    if (!answer) return;
    this.all = answer.alarms;
    /** @type {Map<string, "warning" | "alarm">} */
    const tags = new Map();
    for (const alarm of this.all.filter((one) => one.over_ns === null && !isMuted(one))) {
      for (const tag of tagsOf(alarm)) if (RANK[alarm.severity] > this.#rank(tags.get(tag))) tags.set(tag, alarm.severity);
    }
    this.tags = tags;
  }

  /** Alarms that are open, and that nobody has acknowledged or muted: they want somebody. */
  get pending() {
    return this.all.filter(isPending);
  }

  /** @param {string} tag 2: it has an alarm, 1: a warning, 0: neither */
  rank(tag) {
    return this.#rank(this.tags.get(tag));
  }

  /** Say that somebody has seen an alarm. Throws Error with the sentence of the service. @param {Alarm} alarm @param {string} note */
  async acknowledge({ id }, note) {
    await send(api(`alarms/${id}/acknowledgement`), "PUT", { note });
    await this.refresh();
  }

  /** @param {"warning" | "alarm" | undefined} severity */
  #rank(severity) {
    return severity === undefined ? 0 : RANK[severity];
  }
}

/** The tags that an alarm is about: two where they are too close. @param {Alarm} alarm */
export const tagsOf = ({ event }) => [event.subject, ...(event.data.other_tag ? [event.data.other_tag] : [])];

/** @param {Alarm} alarm */
export const isMuted = ({ muted_until_ns }) => muted_until_ns !== null && muted_until_ns / 1e6 > Date.now();

/** @param {Alarm} alarm */
export const isPending = (alarm) => alarm.over_ns === null && alarm.acknowledged === null && !isMuted(alarm);
