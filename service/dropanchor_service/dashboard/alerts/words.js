/** Destinations and rules in words. */

import { age, counted, percent } from "../data/format.js";

/** @typedef {import("./items.js").Item} Item */
/** @typedef {{destination: Item, has_secret: boolean, pending: number, oldest_ns: number | null, dead: number, problem: string | null}} DestinationState */

/** @type {Record<string, string>} */
export const DESTINATION_TYPES = { email: "e-mail", webhook: "webhook", mqtt: "MQTT topic" };

/** Return where events go, such as `e-mail to shift@example.com`. @param {Item} destination */
export function whereTo({ type, to, url, topic }) {
  return { email: () => `e-mail to ${to.join(", ")}`, webhook: () => `webhook ${url}`, mqtt: () => `MQTT topic ${topic}` }[/** @type {string} */ (type)]?.() ?? type;
}

/** Return the state of a queue in words. @param {DestinationState} state */
export function queueWords({ destination, pending, dead }) {
  const parts = destination.enabled ? [] : ["off"];
  if (pending > 0) parts.push(`${counted(pending, "event")} waiting`);
  if (dead > 0) parts.push(`${counted(dead, "event")} not delivered`);
  return parts.join(" · ") || "nothing waiting";
}

/** Return how many events failing deliveries hold up, and those that were given up. @param {readonly DestinationState[]} states */
export function stuckIn(states) {
  return states.reduce((sum, { pending, dead, problem }) => sum + dead + (problem === null ? 0 : pending), 0);
}

/** @type {Record<string, (rule: Item) => string>} */
const RULES = {
  too_close: ({ distance_m, delay_s }) => `closer than ${distance_m} m for ${delay_s} s`,
  battery_low: ({ fraction }) => `battery below ${percent(fraction)}`,
  lost: ({ after_s }) => `lost for ${age(after_s)}`,
  ambiguous: ({ after_s }) => `ambiguous for ${age(after_s)}`,
};

/** Return when a rule makes an event, and for whom. @param {Item} rule */
export function ruleWords(rule) {
  const who = [...rule.groups.map((/** @type {string} */ group) => `group ${group}`), ...rule.tags];
  return `${RULES[rule.type]?.(rule) ?? rule.type}, ${who.length === 0 ? "all tags" : who.join(", ")}`;
}

/** Return what a zone watches beside entering and leaving; empty: nothing. @param {import("../zones/zone_store.js").Zone} zone */
export function zoneWords({ dwell_s, speed_mps }) {
  const long = dwell_s === null ? [] : [`inside for ${age(dwell_s)}`];
  const fast = speed_mps === null ? [] : [`faster than ${speed_mps} m/s`];
  return [...long, ...fast].join(", or ");
}
