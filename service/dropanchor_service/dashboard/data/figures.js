/** The figures of tags over a period: distance, speed and time in zones. */

import { request } from "./access.js";
import { api } from "./connection.js";
import { nanoseconds } from "./track_reader.js";

const TIMEOUT_MS = 30_000;

/**
 * @typedef {object} TagFigures as in the contract
 * @property {string} tag
 * @property {number} tracked_s
 * @property {number} distance_m
 * @property {number | null} mean_speed_mps
 * @property {number | null} max_speed_mps
 * @property {{zone: string, inside_s: number, stays: number}[]} zones
 *
 * @typedef {{zones: {zone: string, name: string | null}[], tags: TagFigures[]}} Figures
 *
 * @typedef {{from_ms: number, to_ms: number, group: string}} Wanted
 */

/** The figures of a tag that are the same for every site, in the order of the columns. @type {readonly ("tracked_s" | "distance_m" | "mean_speed_mps" | "max_speed_mps")[]} */
export const FIGURES = ["tracked_s", "distance_m", "mean_speed_mps", "max_speed_mps"];

/** @param {Wanted} wanted @param {string} format */
export function urlOf({ from_ms, to_ms, group }, format) {
  const url = api("figures");
  /** @type {Record<string, string>} */
  const which = group !== "" ? { group } : {};
  url.search = new URLSearchParams({ from: nanoseconds(from_ms), to: nanoseconds(to_ms), format, ...which }).toString();
  return url;
}

/** @param {Wanted} wanted @returns {Promise<Figures>} */
export async function readFigures(wanted) {
  return (await request(urlOf(wanted, "json"), { signal: AbortSignal.timeout(TIMEOUT_MS) })).json();
}

/** Return the lines of a table: the tag, its figures, and the seconds in each zone. @param {Figures} figures
 * @returns {{tag: string, values: (number | null)[]}[]} */
export function linesOf({ zones, tags }) {
  return tags.map((tag) => {
    const inside = new Map(tag.zones.map((time) => [time.zone, time.inside_s]));
    return { tag: tag.tag, values: [...FIGURES.map((name) => tag[name]), ...zones.map(({ zone }) => inside.get(zone) ?? 0)] };
  });
}

/** Return the lines with the largest value first; lines without a value come last, and equal ones by name.
 * @template {{tag: string, values: (number | null)[]}} Line
 * @param {readonly Line[]} lines @param {number} column of the values; −1: by name @returns {Line[]} */
export function ordered(lines, column) {
  const value = (/** @type {Line} */ { values }) => (column < 0 ? 0 : values[column] ?? -1);
  return [...lines].sort((a, b) => value(b) - value(a) || a.tag.localeCompare(b.tag, undefined, { numeric: true }));
}
