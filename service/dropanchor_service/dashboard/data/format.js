/** Format numbers for people. An unknown value (NaN, null) becomes an en dash. */

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
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** Format a coordinate for a narrow column, with fewer decimals the larger it is. @param {number | null | undefined} value */
export function coordinate(value) {
  return known(value) ? fixed(value, Math.abs(value) < 100 ? 2 : Math.abs(value) < 1000 ? 1 : 0) : UNKNOWN;
}

/** @param {number | null | undefined} value */
export const metres = (value) => (known(value) ? `${fixed(value, 2)} m` : UNKNOWN);

/** Format a standard deviation in metres, with fewer decimals the larger it is. @param {number | null | undefined} value */
export function sigma(value) {
  if (!known(value)) return UNKNOWN;
  return fixed(value, value < 10 ? 2 : value < 100 ? 1 : 0);
}

const POINTS = ["N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW"];

/** Format a heading as on a compass: degrees clockwise from north and the nearest of 16 points, such as `337° NNW`.
 * @param {number | null | undefined} rad counter-clockwise from east, as in the interfaces */
export function compass(rad) {
  if (!known(rad)) return UNKNOWN;
  const turned = (((90 - Math.round((rad * 180) / Math.PI)) % 360) + 360) % 360;
  return `${turned}° ${POINTS[Math.round(turned / 22.5) % 16]}`;
}

/** Format a yaw rate as degrees per second to the left or to the right. @param {number | null | undefined} radps counter-clockwise */
export function turnRate(radps) {
  if (!known(radps)) return UNKNOWN;
  const turned = Math.round((radps * 180) / Math.PI);
  return `${Math.abs(turned)} °/s${turned === 0 ? "" : turned > 0 ? " left" : " right"}`;
}

/** @param {number | null | undefined} share 0 to 1 */
export function percent(share) {
  if (!known(share)) return UNKNOWN;
  if (share > 0.99 && share < 1) return `${(Math.floor(share * 1000) / 10).toFixed(1)} %`;
  return `${Math.round(share * 100)} %`;
}

/** @param {number | null | undefined} seconds */
export function age(seconds) {
  if (!known(seconds)) return UNKNOWN;
  if (seconds < 9.95) return `${Math.max(0, seconds).toFixed(1)} s`;
  if (seconds < 99.5) return `${Math.round(seconds)} s`;
  if (seconds < 5970) return `${Math.round(seconds / 60)} min`;
  if (seconds < 48 * 3600) return `${Math.round(seconds / 3600)} h`;
  return `${Math.round(seconds / 86400)} d`;
}

/** Format the distance of a ring or scale bar, such as 0.5 m, 20 m or 2 km. @param {number} value_m */
export function distance(value_m) {
  if (value_m >= 1000) return `${Number((value_m / 1000).toPrecision(6))} km`;
  if (value_m < 0.1) return `${Number((value_m * 100).toPrecision(6))} cm`;
  return `${Number(value_m.toPrecision(6))} m`;
}

/** @param {number} count @param {string} noun */
export const counted = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;

/** Format a machine-readable name for people: `several_modes` → "several modes". @param {string} word */
export const words = (word) => word.replaceAll("_", " ");
