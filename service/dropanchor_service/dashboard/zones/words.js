/** Events in words, and times for people. */

import { age, fixed, percent } from "../data/format.js";

/**
 * An event of the service: a CloudEvent.
 * @typedef {object} ServiceEvent
 * @property {string} id
 * @property {string} type
 * @property {string} subject id of the tag
 * @property {string} time RFC 3339
 * @property {string} sequence
 * @property {{t_ns: number, since_ns: number, zone: string | null, rule: string | null, name: string,
 *   probability: number | null, other_tag: string | null, distance_m: number | null, speed_mps: number | null,
 *   battery_fraction: number | null}} data
 */

/** @type {Record<string, (tag: string, place: string, data: ServiceEvent["data"]) => string>} */
const SENTENCES = {
  "dropanchor.zone.enter": (tag, place) => `${tag} entered ${place}`,
  "dropanchor.zone.exit": (tag, place) => `${tag} left ${place}`,
  "dropanchor.zone.dwell": (tag, place, data) => `${tag} has been in ${place} for ${lasted(data)}`,
  "dropanchor.zone.speed": (tag, place, data) => `${tag} is too fast in ${place}: ${fixed(data.speed_mps, 1)} m/s`,
  "dropanchor.tags.too_close": (tag, _, data) => `${tag} and ${data.other_tag} are too close: ${fixed(data.distance_m, 1)} m`,
  "dropanchor.tag.battery_low": (tag, _, data) => `The battery of ${tag} is low: ${percent(data.battery_fraction)}`,
  "dropanchor.tag.lost": (tag, _, data) => `${tag} has been lost for ${lasted(data)}`,
  "dropanchor.tag.ambiguous": (tag, _, data) => `${tag} has been ambiguous for ${lasted(data)}`,
};

/** Return what happened, such as `cart-3 entered Yard`. @param {ServiceEvent} event */
export function sentence({ type, subject, data }) {
  const place = data.name || data.zone || data.rule || "";
  return SENTENCES[type]?.(subject, place, data) ?? `${subject}: ${type}`;
}

/** Return the probability of an event, such as `P 0.96`; empty where it has none. It is never rounded up to 1.
 * @param {ServiceEvent} event */
export function probability({ data }) {
  if (data.probability === null) return "";
  return `P ${(data.probability < 1 ? Math.floor(data.probability * 100) / 100 : 1).toFixed(2)}`;
}

/** Return the local time of an event, with the date unless it is today. @param {ServiceEvent} event @param {Date} [now] */
export function clock({ time }, now = new Date()) {
  const at = new Date(time);
  const two = (/** @type {number} */ value) => String(value).padStart(2, "0");
  const text = [at.getHours(), at.getMinutes(), at.getSeconds()].map(two).join(":");
  if (at.toDateString() === now.toDateString()) return text;
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())} ${text}`;
}

/** @param {ServiceEvent["data"]} data */
const lasted = ({ t_ns, since_ns }) => age((t_ns - since_ns) / 1e9);
