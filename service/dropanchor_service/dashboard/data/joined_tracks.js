/** The tracks of several tags in one file: each as the service exports it, with the id of its tag. */

import { request } from "./access.js";
import { api } from "./connection.js";
import { nanoseconds } from "./track_reader.js";

/** @typedef {{tag: string, text: string}} Exported */

/** Read the tracks one after another, so that the service answers others meanwhile, and join them.
 * @param {readonly string[]} tags @param {number} from_ms @param {number} to_ms @param {"csv" | "geojson"} format
 * @param {(done: number) => void} progress */
export async function readJoined(tags, from_ms, to_ms, format, progress) {
  /** @type {Exported[]} */
  const parts = [];
  for (const tag of tags) {
    progress(parts.length);
    const url = api(`tags/${encodeURIComponent(tag)}/track/file`);
    url.search = new URLSearchParams({ format, from: nanoseconds(from_ms), to: nanoseconds(to_ms) }).toString();
    parts.push({ tag, text: await (await request(url, {})).text() });
  }
  return format === "csv" ? joinedCsv(parts) : joinedGeojson(parts);
}

/** Return one table whose first column is the tag. @param {readonly Exported[]} parts with the same columns */
export function joinedCsv(parts) {
  const tables = parts.map(({ tag, text }) => ({ tag, lines: text.split("\r\n").filter((line) => line !== "") }));
  const head = tables.find(({ lines }) => lines.length > 0)?.lines[0] ?? "";
  return [`tag,${head}`, ...tables.flatMap(({ tag, lines }) => lines.slice(1).map((line) => `${cell(tag)},${line}`))].map((line) => `${line}\r\n`).join("");
}

/** Return one collection whose features name their tag. @param {readonly Exported[]} parts */
export function joinedGeojson(parts) {
  const features = parts.flatMap(({ tag, text }) => JSON.parse(text).features.map(
    (/** @type {{properties: object}} */ feature) => ({ ...feature, properties: { tag, ...feature.properties } }),
  ));
  return JSON.stringify({ type: "FeatureCollection", features });
}

/** @param {string} text */
const cell = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
