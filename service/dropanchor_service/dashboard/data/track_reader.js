/** Request tracks, and read the answer in a worker. */

import { api } from "./connection.js";
import { request } from "./access.js";
import { Tracks } from "./tracks.js";

const TIMEOUT_MS = 60_000;

/** @type {Worker | null} */
let worker = null;
let requests = 0;
/** @type {Map<number, (tracks: Tracks) => void>} */
const waiting = new Map();

/** Return the thinned tracks over a period. @param {number} from_ms @param {number} to_ms @param {number} points of each tag
 * @param {{tags?: readonly string[], signal?: AbortSignal}} [options] tags: only these @returns {Promise<Tracks>} */
export async function readTracks(from_ms, to_ms, points, { tags, signal } = {}) {
  const signals = [AbortSignal.timeout(TIMEOUT_MS), ...(signal ? [signal] : [])];
  const response = await request(tracksUrl(from_ms, to_ms, points, tags), { signal: AbortSignal.any(signals) });
  const content = await response.arrayBuffer();
  const number = requests++;
  return new Promise((resolve) => {
    waiting.set(number, resolve);
    theWorker().postMessage({ number, content }, [content]);
  });
}

function theWorker() {
  if (worker) return worker;
  worker = new Worker(new URL("track_worker.js", import.meta.url), { type: "module" });
  worker.addEventListener("message", ({ data: { number, all } }) => {
    waiting.get(number)?.(new Tracks(all));
    waiting.delete(number);
  });
  return worker;
}

/** @param {number} from_ms @param {number} to_ms @param {number} points @param {readonly string[]} [tags] */
function tracksUrl(from_ms, to_ms, points, tags) {
  const url = api("tracks");
  url.search = new URLSearchParams([
    ["from", nanoseconds(from_ms)], ["to", nanoseconds(to_ms)], ["max_points", String(points)], ...(tags ?? []).flatMap(onlyTag),
  ]).toString();
  return url;
}

/** Return the parameters that select one tag. Repeated, a value is one id, also with a comma in it. @param {string} tag */
export const onlyTag = (tag) => [["tags", tag], ["tags", tag]];

/** @param {number} time_ms */
export const nanoseconds = (time_ms) => `${Math.max(0, Math.round(time_ms))}000000`;
