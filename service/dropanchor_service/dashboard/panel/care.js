/** What the selected tag reports about itself. */

import { age, ago, fixed, percent } from "../data/format.js";
import { t } from "../i18n/language.js";

/** @typedef {import("../data/roster.js").Health} Health */

/** Return what a tag reports about itself, as terms and values for people. @param {Health} health @returns {[string, string][]} */
export function healthTexts(health) {
  const { battery_fraction, battery_v, temperature_c, rssi_dbm, firmware, spool_bytes, spool_oldest_s, lost_messages } = health;
  /** @type {[string, (string | null)[]][]} */
  const texts = [
    [t("health.battery"), [unless(battery_fraction, percent), unless(battery_v, (volts) => `${fixed(volts, 2)} V`)]],
    [t("health.temperature"), [unless(temperature_c, (value) => `${fixed(value, 0)} °C`)]],
    [t("health.signal"), [unless(rssi_dbm, (value) => `${fixed(value, 0)} dBm`)]],
    [t("health.firmware"), [firmware ?? null]],
    [t("health.spool"), [unless(spool_bytes, megabytes), spool_bytes ? unless(spool_oldest_s, (value) => t("health.since", { age: age(value) })) : null]],
    [t("health.lost"), [lost_messages ? t("count.messages", { n: lost_messages }) : null]],
    [t("health.reported"), [ago(health.age_s)]],
  ];
  return texts.map(([term, parts]) => /** @type {[string, string]} */ ([term, parts.filter((part) => part !== null).join(" · ")]))
    .filter(([, text]) => text !== "");
}

/** Return how far the clock of a tag's motion is ahead of that of its ranges.
 * @param {{offset_s: number, uncertainty_s: number}} clock */
export const clockText = ({ offset_s, uncertainty_s }) =>
  t(offset_s < 0 ? "clock.behind" : "clock.ahead", { offset: `${fixed(Math.abs(offset_s), 2)} s`, sigma: `${fixed(uncertainty_s, 2)} s` });

/** @param {number} bytes */
const megabytes = (bytes) => (bytes === 0 ? t("health.empty") : `${fixed(bytes / 1e6, 1)} MB`);

/** @template T @param {T | undefined | null} value @param {(value: T) => string} format */
const unless = (value, format) => (value === undefined || value === null ? null : format(value));
