/** The time zone of the page: that of the site, or else of the browser. Times of the clock on the wall are written as forms have them, such as 2026-01-31T14:03:05. */

/** The zone of the site; undefined: it has none. @type {string | undefined} */
let ofSite;

/** @param {string | null | undefined} name as IANA has it */
export const setTimeZone = (name) => void (ofSite = name ?? undefined);

export const timeZone = () => ofSite;

/** Return what the page says of its zone, and whether the site has chosen it. */
export const shownZone = () => ({ name: ofSite ?? Intl.DateTimeFormat().resolvedOptions().timeZone, isOfSite: ofSite !== undefined });

/** @type {Map<string | undefined, Intl.DateTimeFormat>} */
const clocks = new Map();

/** Return how far the clocks on the wall are ahead of UTC. @param {number} time_ms */
function ahead_ms(time_ms) {
  let clock = clocks.get(ofSite);
  if (!clock) clocks.set(ofSite, (clock = new Intl.DateTimeFormat("en", { timeZone: ofSite, calendar: "iso8601", hourCycle: "h23", year: "numeric", month: "numeric", day: "numeric", hour: "numeric", minute: "numeric", second: "numeric" })));
  const { year, month, day, hour, minute, second } = Object.fromEntries(clock.formatToParts(time_ms).map(({ type, value }) => [type, Number(value)]));
  return Date.UTC(year, month - 1, day, hour, minute, second) - Math.floor(time_ms / 1000) * 1000;
}

/** Return the time on the wall. @param {number} time_ms */
export const wallTime = (time_ms) => new Date(time_ms + ahead_ms(time_ms)).toISOString().slice(0, 19);

/** Return the date on the wall, some days later. @param {number} time_ms @param {number} [days] */
export const wallDate = (time_ms, days = 0) => new Date(Date.parse(`${wallTime(time_ms)}Z`) + days * 86_400_000).toISOString().slice(0, 10);

/** Return the time in ms at which the wall shows a time; NaN if there is none. @param {string} wall */
export function timeOf(wall) {
  const utc_ms = Date.parse(`${wall}Z`);
  if (Number.isNaN(utc_ms)) return NaN;
  return utc_ms - ahead_ms(utc_ms - ahead_ms(utc_ms));
}
