/** The period, time and speed of the past in the address of the page, so that a link leads to the same moment. */

/** @typedef {{from_ms: number, to_ms: number, time_ms: number, speed: number}} Moment */

/** @param {string} hash such as `#from=2026-01-31T09:00:00.000Z&to=…` @returns {Moment | null} null: the present */
export function momentIn(hash) {
  const values = new URLSearchParams(hash.replace(/^#/, ""));
  const [from_ms, to_ms, at_ms] = ["from", "to", "at"].map((name) => Date.parse(values.get(name) ?? ""));
  if (!(from_ms >= 0 && to_ms > from_ms)) return null;
  const time_ms = at_ms >= from_ms && at_ms <= to_ms ? at_ms : from_ms;
  return { from_ms, to_ms, time_ms, speed: Number(values.get("speed") ?? 1) };
}

/** Return the values of a moment in the address; null removes each. @param {Moment | null} moment @returns {Record<string, string | null>} */
export function momentValues(moment) {
  if (!moment) return { from: null, to: null, at: null, speed: null };
  const iso = (/** @type {number} */ time_ms) => new Date(time_ms).toISOString();
  const { from_ms, to_ms, time_ms, speed } = moment;
  return { from: iso(from_ms), to: iso(to_ms), at: iso(time_ms), speed: String(speed) };
}
