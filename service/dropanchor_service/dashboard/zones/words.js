/** Events in words, and times for people. */

import { age, fixed, length, percent, speed } from "../data/format.js";
import { has, t, timeText } from "../i18n/language.js";

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

/** Return what happened, such as `cart-3 entered Yard`. @param {ServiceEvent} event */
export function sentence({ type, subject, data }) {
  const key = `event.${type}`;
  if (!has(key)) return t("event.other", { tag: subject, type });
  return t(key, {
    tag: subject, place: data.name || data.zone || data.rule || "", other: data.other_tag ?? "",
    time: age((data.t_ns - data.since_ns) / 1e9), speed: speed(data.speed_mps, 1), distance: length(data.distance_m, 1),
    battery: percent(data.battery_fraction),
  });
}

/** Return the probability of an event, such as `P 0.96`; empty where it has none. It is never rounded up to 1.
 * @param {ServiceEvent} event */
export function probability({ data }) {
  if (data.probability === null) return "";
  return t("event.probability", { probability: fixed(data.probability < 1 ? Math.floor(data.probability * 100) / 100 : 1, 2) });
}

/** Return the local time of an event, with the date unless it is today. @param {ServiceEvent} event @param {Date} [now] */
export function clock({ time }, now = new Date()) {
  const at = new Date(time);
  const isToday = at.toDateString() === now.toDateString();
  return timeText(at, { ...(isToday ? {} : { dateStyle: "medium" }), timeStyle: "medium" });
}
