/** Format numbers for people. An unknown value (NaN, null) becomes an en dash. */

import { count, decimal, has, t } from "../i18n/language.js";
import { units } from "./units.js";

export const UNKNOWN = "–";
const MINUS = "−";

/** @param {number | null | undefined} value @returns {value is number} */
const known = (value) => typeof value === "number" && Number.isFinite(value);

/**
 * A fixed number of decimals with a true minus sign and no negative zero.
 * @param {number | null | undefined} value
 * @param {number} decimals
 */
export function fixed(value, decimals) {
  if (!known(value)) return UNKNOWN;
  const isNegative = value < 0 && Number(value.toFixed(decimals)) !== 0;
  return (isNegative ? MINUS : "") + decimal(Math.abs(value), decimals);
}

/** Return a length in the unit of the page. @param {number | null | undefined} value_m */
const inUnit = (value_m) => (known(value_m) ? value_m * units.length.factor : NaN);

/** Format a coordinate for a narrow column, with fewer decimals the larger it is. @param {number | null | undefined} value_m */
export function coordinate(value_m) {
  const value = inUnit(value_m);
  return fixed(value, Math.abs(value) < 100 ? 2 : Math.abs(value) < 1000 ? 1 : 0);
}

/** Format a length with its unit. @param {number | null | undefined} value_m @param {number} [decimals] */
export const length = (value_m, decimals = 2) => (known(value_m) ? `${fixed(inUnit(value_m), decimals)} ${units.length.symbol}` : UNKNOWN);

/** Format half a width, with fewer decimals the larger it is. @param {number | null | undefined} value_m */
export function half(value_m) {
  const value = inUnit(value_m);
  return fixed(value, value < 10 ? 2 : value < 100 ? 1 : 0);
}

const POINTS = t("compass.points").split(" ");

/** Format a heading as on a compass: degrees clockwise from north and the nearest of 16 points, such as `337° NNW`.
 * @param {number | null | undefined} rad counter-clockwise from east, as in the interfaces */
export function compass(rad) {
  if (!known(rad)) return UNKNOWN;
  const turned = (((90 - Math.round((rad * 180) / Math.PI)) % 360) + 360) % 360;
  return `${turned}° ${POINTS[Math.round(turned / 22.5) % 16]}`;
}

/** Format how far something is turned: degrees without a sign, by the shorter way. @param {number} rad */
export const compassTurn = (rad) => `${Math.round(Math.abs(Math.atan2(Math.sin(rad), Math.cos(rad))) * (180 / Math.PI))}°`;

/** Format a yaw rate as degrees per second to the left or to the right. @param {number | null | undefined} radps counter-clockwise */
export function turnRate(radps) {
  if (!known(radps)) return UNKNOWN;
  const turned = Math.round((radps * 180) / Math.PI);
  const rate = `${Math.abs(turned)} °/s`;
  return turned === 0 ? rate : t(turned > 0 ? "turn.left" : "turn.right", { rate });
}

/** @param {number | null | undefined} share 0 to 1 */
export function percent(share) {
  if (!known(share)) return UNKNOWN;
  if (share > 0.99 && share < 1) return `${decimal(Math.floor(share * 1000) / 10, 1)} %`;
  return `${Math.round(share * 100)} %`;
}

/** @param {number | null | undefined} seconds */
export function age(seconds) {
  if (!known(seconds)) return UNKNOWN;
  if (seconds < 9.95) return `${decimal(Math.max(0, seconds), 1)} s`;
  if (seconds < 99.5) return `${Math.round(seconds)} s`;
  if (seconds < 5970) return `${Math.round(seconds / 60)} min`;
  if (seconds < 48 * 3600) return `${Math.round(seconds / 3600)} h`;
  return `${Math.round(seconds / 86400)} d`;
}

/** Format a time that is to be compared or added up, such as 1:05:09. @param {number} seconds */
export function duration(seconds) {
  const whole = Math.round(seconds);
  const two = (/** @type {number} */ value) => String(value % 60).padStart(2, "0");
  return `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60))}:${two(whole)}`;
}

/** Format the distance of a ring or scale bar, such as 0.5 m, 20 m or 2 km. @param {number} value_m @param {number} [digits] at most */
export function distance(value_m, digits = 6) {
  const short = (/** @type {number} */ value) => decimal(Number(value.toPrecision(digits)), 0, 6);
  if (units.length.symbol !== "m") return `${short(inUnit(value_m))} ${units.length.symbol}`;
  if (value_m >= 1000) return `${short(value_m / 1000)} km`;
  if (value_m < 0.1) return `${short(value_m * 100)} cm`;
  return `${short(value_m)} m`;
}

/** Format a speed. @param {number | null | undefined} value_mps @param {number} [decimals] */
export const speed = (value_mps, decimals = 2) => `${speedNumber(value_mps, decimals)} ${units.velocity.symbol}`;

/** Format a limit of speed, without needless digits. @param {number} value_mps */
export const speedLimit = (value_mps) => `${decimal(Number((value_mps * units.velocity.factor).toPrecision(4)), 0, 3)} ${units.velocity.symbol}`;

/** Format a speed without its unit. @param {number | null | undefined} value_mps @param {number} decimals */
export const speedNumber = (value_mps, decimals) => fixed(known(value_mps) ? value_mps * units.velocity.factor : NaN, decimals);

/** Format a place on the map. @param {number} x m @param {number} y m @param {number} decimals */
export const place = (x, y, decimals) => t("place", { x: fixed(inUnit(x), decimals), y: fixed(inUnit(y), decimals), unit: units.length.symbol });

/** Format a place in space. @param {number} x m @param {number} y m @param {number} z m */
export const place3 = (x, y, z) => t("place3", {
  x: fixed(inUnit(x), 2), y: fixed(inUnit(y), 2), z: fixed(inUnit(z), 2), unit: units.length.symbol,
});

/** Format how far a tag may be from its dot, along and across its ellipse. @param {number} major_m semi-axis @param {number} minor_m semi-axis */
export function accuracy(major_m, minor_m) {
  if (!known(major_m) || !known(minor_m)) return UNKNOWN;
  const { symbol } = units.length;
  return t("figure.along_across", { along: `${half(major_m)} ${symbol}`, across: `${half(minor_m)} ${symbol}` });
}

/**
 * Format a height with its standard deviation and where it comes from.
 *
 * @param {number | null | undefined} z_m
 * @param {number | null | undefined} std_m
 * @param {string | null | undefined} source as `z_source` in the stream
 */
export function height(z_m, std_m, source) {
  if (!known(z_m) || !known(std_m) || !source) return UNKNOWN;
  if (source === "unknown") return t("figure.height_unknown");
  if (source === "told") return t("figure.height_told", { height: length(z_m) });
  if (source === "start") return t("figure.height_start", { height: length(z_m), error: length(std_m) });
  return t("figure.height_pressure", { height: length(z_m), error: length(std_m) });
}

/** Format a floor with its probability; empty without one.
 * @param {string | null | undefined} name @param {number | null | undefined} probability */
export const floor = (name, probability) => (name ? t("figure.floor_probability", { floor: name, probability: percent(probability) }) : "");

/** Format a number of tags. @param {number} n */
export const tagCount = (n) => t("count.tags", { n });

/** Format a time of the past. @param {number | null | undefined} seconds */
export const ago = (seconds) => t("ago", { age: age(seconds) });

export { count };

/** Return a text of the catalogue or of the service with its metres in the unit of the page. @param {string} text */
export const withUnits = (text) => (units.length.factor === 1 ? text
  : text.replace(/(\d+(?:[.,]\d+)?) m(?![\w/²])/g, (_, metres) => `${decimal(Number(metres.replace(",", ".")) * units.length.factor, 0, 2)} ${units.length.symbol}`));

/** Return a machine-readable name in words: `several_modes` → "several modes". @param {string} word */
export const words = (word) => (has(`word.${word}`) ? t(`word.${word}`) : word.replaceAll("_", " "));
