/** Events and changes of zones in words, and times for people. */

import { wallDate } from "../data/time_zone.js";
import { age, fixed, length, percent, speed } from "../data/format.js";
import { has, keysAfter, t, timeText } from "../i18n/language.js";

/** @typedef {import("./zone_store.js").Zone} Zone @typedef {import("./zone_store.js").Shape} Shape */

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
 *   battery_fraction: number | null, retracts?: string | null, retracted_type?: string | null,
 *   reason?: string | null, severity?: string | null, alarm?: string | null, alarm_type?: string | null,
 *   acknowledged_by?: string | null, note?: string | null}} data
 */

/** The kinds of events of a site, and those of them that zones and rules make. */
export const ALL_KINDS = keysAfter("kind.").filter((type) => type !== "dropanchor.destination.test");
export const KINDS = ALL_KINDS.filter((type) => /^dropanchor\.(zone|tags?)\./.test(type));

/** Return the kind of event that a rule makes. @param {string} type of the rule */
export const kindOfRule = (type) => kind(KINDS.find((one) => one.endsWith(`.${type}`)) ?? type);

/** Return what happened, such as `cart-3 entered Yard`. @param {ServiceEvent} event */
export function sentence({ type, subject, data }) {
  const key = `event.${type}`;
  if (!has(key)) return t("event.other", { tag: subject, type });
  return t(key, {
    tag: subject, place: data.name || data.zone || data.rule || "", other: data.other_tag ?? "",
    time: age((data.t_ns - data.since_ns) / 1e9), speed: speed(data.speed_mps, 1), distance: length(data.distance_m, 1),
    battery: percent(data.battery_fraction), why: why(data.reason), before: kind(data.retracted_type ?? data.alarm_type),
    who: data.acknowledged_by ? `(${data.acknowledged_by})` : "", note: data.note ?? "",
  }).trim();
}

/** Return what kind of event this is, in words. @param {string | null} [type] */
export const kind = (type) => (type && has(`kind.${type}`) ? t(`kind.${type}`) : type ?? "");

/** Return why an event is not true, in words. @param {string | null} [reason] */
export const why = (reason) => (reason && has(`event.why.${reason}`) ? t(`event.why.${reason}`) : reason ?? "");

/** Return the probability of an event, such as `P 0.96`; empty where it has none. It is never rounded up to 1.
 * @param {ServiceEvent} event */
export function probability({ data }) {
  if (data.probability === null) return "";
  return t("event.probability", { probability: fixed(data.probability < 1 ? Math.floor(data.probability * 100) / 100 : 1, 2) });
}

/** Return the time of an event, with the date unless it is today. @param {{time: string | number}} event @param {Date} [now] */
export function clock({ time }, now = new Date()) {
  const at = new Date(time);
  const isToday = wallDate(at.getTime()) === wallDate(now.getTime());
  return timeText(at, { ...(isToday ? {} : { dateStyle: "medium" }), timeStyle: "medium" });
}

/** Return a time in full, with its zone: two people who talk of it may be in different ones. @param {string | number} time */
export const fullTime = (time) => timeText(new Date(time), { dateStyle: "full", timeStyle: "long" });

/** Return what a change did to a zone, as a sentence. @param {Zone | null} before null: it is new @param {Zone | null} after null: it is deleted */
export function zoneChange(before, after) {
  const { name, id } = /** @type {Zone} */ (after ?? before);
  const words = { zone: name || id, before: before?.name || id };
  if (before === null) return t("zone.added", words);
  if (after === null) return t("zone.deleted", words);
  const changed = Object.keys(after).filter((key) => JSON.stringify(after[/** @type {keyof Zone} */ (key)]) !== JSON.stringify(before[/** @type {keyof Zone} */ (key)]));
  if (changed.join() === "name") return t("zone.renamed", words);
  if (changed.join() === "shape") return t(isMoved(before.shape, after.shape) ? "zone.moved" : "zone.reshaped", words);
  return t("zone.changed", words);
}

/** Return whether a shape is the same elsewhere. @param {Shape} before @param {Shape} after */
const isMoved = (before, after) => before.type === "circle" && after.type === "circle" && before.radius_m === after.radius_m;
