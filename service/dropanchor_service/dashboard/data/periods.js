/** Periods of the past by name, in the time zone of the page. */

import { timeOf, wallDate } from "./time_zone.js";

export const HOUR_MS = 3_600_000;
const MOMENT_MS = 5000;
export const LONGEST_MS = 31 * 24 * HOUR_MS;

/** @typedef {{from_ms: number, to_ms: number}} Period */

/** The quick choices: the last hour, eight hours as a shift has them, today until now, and yesterday. */
export const QUICK = /** @type {const} */ (["hour", "shift", "today", "yesterday"]);

/** Return the period of a quick choice. @param {typeof QUICK[number]} choice @param {number} now_ms @returns {Period} */
export function quickPeriod(choice, now_ms) {
  if (choice === "hour") return { from_ms: now_ms - HOUR_MS, to_ms: now_ms };
  if (choice === "shift") return { from_ms: now_ms - 8 * HOUR_MS, to_ms: now_ms };
  if (choice === "today") return { from_ms: midnight(now_ms, 0), to_ms: now_ms };
  return { from_ms: midnight(now_ms, -1), to_ms: midnight(now_ms, 0) };
}

/** Return a whole day, until now if it is today; null for no date, and for a day that has not begun. @param {string} date such as 2026-01-31
 * @param {number} now_ms @returns {Period | null} */
export function dayOf(date, now_ms) {
  const from_ms = timeOf(`${date}T00:00`);
  return from_ms < now_ms ? { from_ms, to_ms: Math.min(now_ms, midnight(from_ms, 1)) } : null;
}

/** Return the last hour with poses: from its first pose to the newest. @param {readonly Period[]} stretches with poses, of that hour @param {number} to_ms its end
 * @param {number} oldest_ms of all poses @returns {Period} */
export const lastHour = (stretches, to_ms, oldest_ms) => ({
  from_ms: Math.max(to_ms - HOUR_MS, stretches[0]?.from_ms ?? oldest_ms), to_ms,
});

/** Return the time without poses around a moment, within a period; null if there are poses. @param {readonly Period[]} stretches with poses, in order
 * @param {Period} period @param {number} time_ms @returns {Period | null} */
export function gapAt(stretches, { from_ms, to_ms }, time_ms) {
  const next = stretches.findIndex((stretch) => stretch.to_ms > time_ms);
  if (next >= 0 && stretches[next].from_ms <= time_ms) return null;
  const before = next < 0 ? stretches.at(-1) : stretches[next - 1];
  return { from_ms: Math.max(from_ms, before?.to_ms ?? from_ms), to_ms: Math.min(to_ms, next < 0 ? to_ms : stretches[next].from_ms) };
}

/** Return the end of the pause that holds a time: of a gap, or of a stop; the time itself where there is none. A moment is left at both ends.
 * @param {readonly Period[]} pauses @param {number} time_ms */
export function afterPause(pauses, time_ms) {
  const pause = pauses.find(({ from_ms, to_ms }) => time_ms > from_ms + MOMENT_MS && time_ms < to_ms - MOMENT_MS);
  return pause ? pause.to_ms - MOMENT_MS : time_ms;
}

/** Return the times without poses between others. @param {readonly Period[]} stretches with poses, in order */
export const gapsBetween = (stretches) => stretches.slice(1).map(({ from_ms }, i) => ({ from_ms: stretches[i].to_ms, to_ms: from_ms }));

/** Return the path of a strip that is 1000 long and 1 high, filled where there are poses. @param {readonly Period[]} stretches @param {Period} period */
export function stripPath(stretches, { from_ms, to_ms }) {
  const along = (/** @type {number} */ time_ms) => Math.round((1000 * (Math.min(to_ms, Math.max(from_ms, time_ms)) - from_ms)) / (to_ms - from_ms));
  return stretches.map((stretch) => {
    const [start, end] = [along(stretch.from_ms), along(stretch.to_ms)];
    return `M${start} 0h${Math.max(1, end - start)}v1H${start}z`; // a moment is seen in a month, too
  }).join("");
}

/** Return the start of a day. @param {number} time_ms on some day @param {number} days after it */
const midnight = (time_ms, days) => timeOf(`${wallDate(time_ms, days)}T00:00`);
