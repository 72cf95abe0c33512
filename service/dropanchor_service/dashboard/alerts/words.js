/** Destinations and rules in words. */

import { age, distance, percent, speedLimit } from "../data/format.js";
import { has, t } from "../i18n/language.js";
import { kindOfRule } from "../zones/words.js";

/** @typedef {import("../data/items.js").Item} Item */
/** @typedef {{destination: Item, has_secret: boolean, pending: number, oldest_ns: number | null, dead: number, problem: string | null}} DestinationState */

/** Return where events go, such as `e-mail to shift@example.com`. @param {Item} destination */
export function whereTo({ type, to, url, topic, prefix }) {
  return has(`destination.${type}_to`) ? t(`destination.${type}_to`, { to: (to ?? []).join(", "), url, topic, prefix }) : type;
}

/** Return the state of a queue in words. @param {DestinationState} state */
export function queueWords({ destination, pending, dead }) {
  const parts = destination.enabled ? [] : [t("queue.off")];
  if (pending > 0) parts.push(t("queue.waiting", { n: pending }));
  if (dead > 0) parts.push(t("queue.dead", { n: dead }));
  return parts.join(" · ") || t("queue.nothing");
}

/** Return how many events failing deliveries hold up, and those that were given up. @param {readonly DestinationState[]} states */
export function stuckIn(states) {
  return states.reduce((sum, { pending, dead, problem }) => sum + dead + (problem === null ? 0 : pending), 0);
}

const SHARED = ["id", "name", "type", "severity", "tags", "groups", "muted_until_ns"];

/** Return the names of the values that only some rules have. @param {object} rule or the schema of its values */
export const ownValues = (rule) => Object.keys(rule).filter((name) => !SHARED.includes(name));

/** Return a value with its unit. @param {string} name which ends with the unit @param {number} value */
const measured = (name, value) => (name.endsWith("_m") ? distance(value, 4) : name.endsWith("_mps") ? speedLimit(value) : name.endsWith("_s") ? age(value) : percent(value));

/** Return when a rule makes an event, and for whom. @param {Item} rule */
export function ruleWords(rule) {
  const words = [kindOfRule(rule.type), ...ownValues(rule).map((name) => `${t(`rule.field.${name}`)} ${measured(name, rule[name])}`)].join(" · ");
  const who = [...rule.groups.map((/** @type {string} */ group) => t("rule.group", { group })), ...rule.tags];
  const made = rule.severity && rule.severity !== "event" ? ` → ${t(`severity.${rule.severity}`)}` : "";
  return t("rule.who", { rule: words + made, who: who.length === 0 ? t("rule.all") : who.join(", ") });
}

/** Return what a zone watches beside entering and leaving; empty: nothing. @param {import("../zones/zone_store.js").Zone} zone */
export function zoneWords({ dwell_s, speed_mps }) {
  const inside = dwell_s === null ? "" : t("rule.zone.inside", { time: age(dwell_s) });
  const faster = speed_mps === null ? "" : t("rule.zone.faster", { speed: speedLimit(speed_mps) });
  return inside && faster ? t("rule.zone.both", { inside, faster }) : inside || faster;
}
