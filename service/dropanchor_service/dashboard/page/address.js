/** The period, time, speed and tag of the past in the address of the page, so that a link leads to the same moment. */

/** @typedef {{from_ms: number, to_ms: number, time_ms: number, speed: number, tag: string | null}} Moment */

/** @param {string} hash such as `#from=2026-01-31T09:00:00.000Z&to=…` @returns {Moment | null} null: the present */
export function momentIn(hash) {
  const values = new URLSearchParams(hash.replace(/^#/, ""));
  const [from_ms, to_ms, at_ms] = ["from", "to", "at"].map((name) => Date.parse(values.get(name) ?? ""));
  if (!(from_ms >= 0 && to_ms > from_ms)) return null;
  const time_ms = at_ms >= from_ms && at_ms <= to_ms ? at_ms : from_ms;
  return { from_ms, to_ms, time_ms, speed: Number(values.get("speed") ?? 1), tag: values.get("tag") };
}

/** Return the hash with this moment, or without one. Other values in it stay. @param {string} hash @param {Moment | null} moment */
export function hashWith(hash, moment) {
  const values = new URLSearchParams(hash.replace(/^#/, ""));
  for (const name of ["from", "to", "at", "speed", "tag"]) values.delete(name);
  if (moment) {
    const iso = (/** @type {number} */ time_ms) => new Date(time_ms).toISOString();
    values.set("from", iso(moment.from_ms));
    values.set("to", iso(moment.to_ms));
    values.set("at", iso(moment.time_ms));
    values.set("speed", String(moment.speed));
    if (moment.tag !== null) values.set("tag", moment.tag);
  }
  const text = values.toString().replaceAll("%3A", ":");
  return text === "" ? "" : `#${text}`;
}
