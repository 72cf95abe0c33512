/** Which settings were set, and who changed what: as the service lists them, and how to take either back. */

import { sendChange } from "./access.js";
import { api, getJson } from "./connection.js";
import { t } from "../i18n/language.js";

/** @typedef {{source: string, file: string | null, at: string[], value: any}} Held */
/** @typedef {Held & {path: string[], hides: Held[]}} Setting */
/** @typedef {{number: number, t_ns: number, by: {source: string, name: string}, kind: string, item: string, before: any, after: any, confirmed: boolean}} Entry */
/**
 * @typedef {object} Back what a resource is brought to
 * @property {string} path
 * @property {boolean} exists now
 * @property {object | null} [value] of the whole resource; null: it is deleted
 * @property {object} [patch] the values that change, in place of `value`
 * @property {any} [expected] what it must be now
 */

const VALUES = 300;
const PAGE = 30;

/** The resources whose changes can be undone. @type {Record<string, (item: string) => string>} */
const PATHS = {
  site: () => "site",
  anchor: (item) => `anchors/${encodeURIComponent(item)}`,
  tag: (item) => `tags/${encodeURIComponent(item)}/settings`,
  zone: (item) => `zones/${encodeURIComponent(item)}`,
  rule: (item) => `event-rules/${encodeURIComponent(item)}`,
};

/** The resource is no longer as it was. */
export class NewerError extends Error {}

/** Return the values that differ from the defaults, those that were set over REST first. @returns {Promise<Setting[]>} */
export async function readSettings() {
  /** @type {{values: Setting[]}} */
  const { values } = await getJson(api(`settings?limit=${VALUES}`));
  return values.filter(({ source }) => source !== "default");
}

/** Return a page of the trail, the newest first. @param {number | null} before the number of the last entry of the page before
 * @returns {Promise<{entries: Entry[], next: number | null}>} */
export const readEntries = (before) => getJson(api(`audit?limit=${PAGE}${before === null ? "" : `&before=${before}`}`));

/** @param {"csv" | "jsonl"} format */
export const trailUrl = (format) => api(`audit/file?format=${format}`);

/** Return how to undo a change; null where that is not possible. @param {Entry} entry @returns {Back | null} */
export function undoOf({ kind, item, before, after }) {
  const pathOf = PATHS[kind];
  if (!pathOf || (before === null && after === null)) return null;
  return { path: pathOf(item), exists: after !== null, value: before, expected: after ?? undefined };
}

/** Return how to give a value that was set over REST back to where it would come from. @param {Setting} setting @returns {Back} */
export function giveBackOf({ path, value, hides: [{ value: hidden }] }) {
  const exists = value !== null;
  if (path[0] === "site" && path[1] === "anchors") return { path: PATHS.anchor(path[2]), exists, value: hidden };
  if (path[0] === "site") return { path: PATHS.site(""), exists: true, patch: { [path[1]]: hidden } };
  if (path.length === 2) return { path: PATHS.tag(path[1]), exists, value: hidden };
  return { path: PATHS.tag(path[1]), exists: true, patch: { [path[2]]: hidden } };
}

/** Bring a resource to what it was. Throws NewerError, and as `sendChange` does.
 * @param {import("./changes.js").Changes} changes @param {string} what is done, as a sentence @param {Back} back */
export async function bringBack(changes, what, { path, exists, value = null, patch, expected }) {
  if (!exists && path.startsWith("tags/")) return void (await sendChange(api(path), "PUT", value, {})); // a deleted tag has settings, too
  const seen = exists ? await changes.read(path) : { value: null, etag: "" };
  if (expected !== undefined && JSON.stringify(seen.value) !== JSON.stringify(expected)) throw new NewerError();
  await changes.apply(what, path, seen, patch ? { ...seen.value, ...patch } : value);
}

/** Return the keys of a changed object whose values differ, with both. @param {any} before @param {any} after @returns {[string, any, any][]} */
export function differences(before, after) {
  if (before === null || after === null) return [];
  const keys = Object.keys({ ...before, ...after });
  return keys.map((key) => /** @type {[string, any, any]} */ ([key, before[key], after[key]]))
    .filter(([, one, other]) => JSON.stringify(one) !== JSON.stringify(other));
}

/** Return where a value is from, for people. @param {Held} held @param {string[]} path of the setting, which the settings file may hold elsewhere, as for all tags */
export function sourceOf({ source, file, at }, path) {
  if (file === null) return t(`trail.from_${source}`);
  const isThere = path.join() === at.join() || path[1] === "anchors";
  return file.replace(/^.*[\\/]/, "") + (isThere ? "" : `: ${at.join(" › ")}`);
}
