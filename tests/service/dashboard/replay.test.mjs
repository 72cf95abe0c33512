import assert from "node:assert/strict";
import { test } from "node:test";

import { hashWith } from "../../../service/dropanchor_service/dashboard/data/address.js";
import { momentIn, momentValues } from "../../../service/dropanchor_service/dashboard/page/address.js";
import { packed } from "../../../service/dropanchor_service/dashboard/data/packed_tracks.js";
import { pieceLength } from "../../../service/dropanchor_service/dashboard/data/replay.js";
import { Tracks, frameAt } from "../../../service/dropanchor_service/dashboard/data/tracks.js";
import { drawTrack } from "../../../service/dropanchor_service/dashboard/map/draw_track.js";
import { trailOf } from "../../../service/dropanchor_service/dashboard/data/past_trails.js";
import { Trails } from "../../../service/dropanchor_service/dashboard/data/trails.js";

/** @param {Record<string, any[]>} columns @returns {any} points one second apart from 0 s, at x = 0, 1, 2 … */
function points(columns = {}, length = 4) {
  const column = (/** @type {(i: number) => any} */ value) => Array.from({ length }, (_, i) => value(i));
  return {
    t_ns: column((i) => i * 1e9), state: column(() => "tracking"), frame: column(() => "site"), x: column((i) => i),
    y: column(() => 5), z: column((i) => 3 * i), z_std_m: column((i) => 0.1 + i), z_source: column(() => "pressure"), floor: column(() => "0"), floor_probability: column(() => 1), heading_rad: column(() => 0), speed_mps: column(() => 1), sigma_pos_m: column(() => 0.2),
    semi_major_m: column((i) => 1 + i), semi_minor_m: column(() => 1), angle_rad: column(() => 0),
    since_previous: column((i) => (i === 0 ? "unknown" : "tracking")), off_m: column(() => 0), ...columns,
  };
}

/** @param {any[]} tracks points of the tags a, b … */
const tracks = (...tracks) => new Tracks(packed(/** @type {any} */ (tracks.map((each, i) => ({ tag: "abc"[i], points: each })))));
const track = (columns = {}) => /** @type {any} */ (tracks(points(columns)).get("a"));

/** Return the pose of the tag a at a time. @param {any} columns @param {number} time_ms @returns {any} */
function poseAt(columns, time_ms) {
  const frame = frameAt(tracks(points(columns)), time_ms);
  return Object.fromEntries(Object.entries(frame).map(([name, values]) => [name, values[0]]));
}

test("between two points of a known way the tag is between them, with the larger ellipse and no age", () => {
  const pose = poseAt({}, 1500);
  assert.deepEqual([pose.x, pose.y, pose.semi_major_m, pose.age_s, pose.state], [1.5, 5, 3, 0, "tracking"]);
});

test("the height of a tag is between two points, and as uncertain as when it changed", () => {
  const pose = poseAt({ z_std_m: [0, 0, 0, 0] }, 1500);
  assert.deepEqual([pose.z, pose.z_std_m, pose.z_source], [4.5, 1.5, "pressure"]);
  const before = poseAt({ z: [null, null, null, null], z_source: [null, null, null, null] }, 1500);
  assert.deepEqual([Number.isNaN(before.z), before.z_source], [true, null]);
});

test("between two points on different floors neither of them is sure", () => {
  const lift = { floor: ["0", "0", "1", "1"] };
  assert.deepEqual([poseAt(lift, 500).floor, poseAt(lift, 500).floor_probability], ["0", 1]);
  assert.deepEqual([poseAt(lift, 1250).floor, poseAt(lift, 1250).floor_probability], ["0", 0.75]);
  assert.deepEqual([poseAt(lift, 1750).floor, poseAt(lift, 1750).floor_probability], ["1", 0.75]);
});

test("before its first point a tag is not in the frame", () => {
  assert.deepEqual(frameAt(tracks(points()), -1).tags, []);
  assert.deepEqual(frameAt(tracks(points()), 0).tags, ["a"]);
});

test("where the way is unknown the tag stays at its last point and grows old", () => {
  const broken = { since_previous: ["unknown", "tracking", "unknown", "tracking"] };
  const pose = poseAt(broken, 1750);
  assert.deepEqual([pose.x, pose.age_s], [1, 0.75]);
  assert.deepEqual([poseAt({}, 63_000).x, poseAt({}, 63_000).age_s], [3, 60]);
});

test("thinned points that are far apart are not joined by a straight line", () => {
  const sparse = { t_ns: [0, 60e9, 120e9, 180e9] };
  assert.deepEqual([poseAt(sparse, 30_000).x, poseAt(sparse, 30_000).age_s], [0, 30]);
});

test("a heading turns the short way round", () => {
  const pose = poseAt({ heading_rad: [3.0, -3.0, 0, 0] }, 500);
  assert.ok(Math.abs(Math.cos(pose.heading_rad) + 1) < 1e-9);
});

test("a pose in a frame of the tag's own has no place on the map, but keeps its state", () => {
  const pose = poseAt({ frame: ["relative", "relative", "site", "site"] }, 500);
  assert.deepEqual([pose.x, pose.y, pose.frame, pose.state], [NaN, NaN, "relative", "tracking"]);
});

test("a past trail breaks where the way is unknown and is doubtful where poses were", () => {
  const trail = trailOf(track({ since_previous: ["unknown", "doubtful", "unknown", "tracking"] }), 3000, 100_000);
  assert.deepEqual(trail.x, [NaN, 0, 1, NaN, 2, 3]);
  assert.deepEqual(trail.trusted, [0, 0, 0, 0, 0, 1]);
  assert.deepEqual(trail.time.slice(-2), [99_000, 100_000]);
});

test("each tag of many has its own points, and one without any is in no frame", () => {
  const three = tracks(points({}, 2), points({}, 0), points({ x: [7, 8, 9, null] }));
  assert.deepEqual([...three].map(({ tag, time }) => [tag, time.length]), [["a", 2], ["b", 0], ["c", 4]]);
  const frame = frameAt(three, 2500);
  assert.deepEqual([frame.tags, [...frame.x], [...frame.age_s]], [["a", "c"], [1, 9], [1.5, 0]]);
});

test("a piece of very many tags is so short that the service reads it pose by pose", () => {
  assert.deepEqual([1, 200, 1000, 10_000, 100_000].map((tags) => pieceLength(tags) / 1000), [600, 500, 100, 10, 10]);
});

test("stored points come before the live ones of a trail", () => {
  const trails = new Trails();
  const fleet = { row: () => 0, state: [2], number: { x: [9], y: [5] } };
  trails.note(/** @type {any} */ (fleet), ["a"], 10_000);
  trails.prepend(track({ since_previous: ["unknown", "tracking", "unknown", "tracking"] }), 7_000);
  const trail = trails.of("a");
  const x = Array.from({ length: trail?.length ?? 0 }, (_, i) => trail?.x[trail.at(i)]);
  assert.deepEqual(x, [0, 1, NaN, 2, 9]); // the point at 10 s is as old as the live one
});

test("a link leads to the same moment, and other values in the address stay", () => {
  const moment = { from_ms: 1e12, to_ms: 1e12 + 3_600_000, time_ms: 1e12 + 1500, speed: 5 };
  const hash = hashWith("#tag=S%C3%BCd+%26+1", momentValues(moment));
  assert.deepEqual(momentIn(hash), moment);
  assert.equal(hashWith(hash, momentValues(null)), "#tag=S%C3%BCd+%26+1");
  for (const bad of ["", "#from=x&to=y", "#from=2026-01-02T00:00Z&to=2026-01-01T00:00Z"]) assert.equal(momentIn(bad), null);
});

test("the line of a period is dashed where poses were doubtful and broken where the way is unknown", () => {
  /** @type {any[]} */
  const drawn = [];
  let dash = "";
  const ctx = {
    setLineDash: (/** @type {number[]} */ pattern) => (dash = pattern.length ? "dashed" : "solid"), beginPath() {}, stroke() {},
    moveTo: (/** @type {number} */ x) => drawn.push([dash, x]), lineTo: (/** @type {number} */ x) => drawn.at(-1).push(x),
  };
  const view = { screenX: (/** @type {number} */ x) => x, screenY: (/** @type {number} */ y) => y, scale: 20 };
  drawTrack(/** @type {any} */ ({ ctx, view, palette: {} }), track({ since_previous: ["unknown", "tracking", "unknown", "doubtful"] }));
  assert.deepEqual(drawn, [["solid", 0, 1], ["dashed", 2, 3]]);
});

test("where stored poses are more than a pixel off the line, or nobody knows, it is dotted as a sketch", () => {
  /** @type {any[]} */
  const drawn = [];
  let dash = "";
  const ctx = {
    setLineDash: (/** @type {number[]} */ dashes) => (dash = dashes.join(" ")), beginPath() {}, stroke() {},
    moveTo: (/** @type {number} */ x) => drawn.push([dash, x]), lineTo: (/** @type {number} */ x) => drawn.at(-1).push(x),
  };
  const view = { screenX: (/** @type {number} */ x) => x, screenY: (/** @type {number} */ y) => y, scale: 20 };
  drawTrack(/** @type {any} */ ({ ctx, view, palette: {} }), track({ off_m: [0, 0.04, 0.06, null] }));
  assert.deepEqual(drawn, [["", 0, 1], ["1 6", 1, 2], ["1 6", 2, 3]]);
});

test("the clock waits for a missing piece, and the tags stay where they are", async () => {
  /** @type {(() => void)[]} */
  const answers = [];
  let number = 0;
  Object.assign(globalThis, {
    document: { baseURI: "http://site/" }, sessionStorage: { getItem: () => null },
    fetch: async () => {
      if (number > 1) await new Promise((resolve) => answers.push(() => resolve(null))); // after the figures and the first piece
      return { ok: true, status: 200, arrayBuffer: async () => new ArrayBuffer(8) };
    },
    Worker: class extends EventTarget {
      postMessage() {
        const all = packed(Array.from({ length: 10_000 }, (_, i) => /** @type {any} */ ({ tag: `tag-${i}`, points: points({}, 1) })));
        this.dispatchEvent(Object.assign(new Event("message"), { data: { number: number++, all } }));
      }
    },
  });
  const { Replay } = await import("../../../service/dropanchor_service/dashboard/data/replay.js");
  const replay = new Replay();
  await replay.open(0, 60_000);
  replay.speed = 10;
  replay.play(true);
  const shown = () => [replay.time_ms, replay.tracks.size];
  for (const at of [3000, 6000, 9000, 9000, 9000]) {
    replay.advance(300);
    assert.deepEqual(shown(), [at, 10_000]);
  }
  answers.forEach((answer) => answer());
  for (let turns = 0; turns < 20; turns++) await Promise.resolve();
  replay.advance(300);
  assert.deepEqual(shown(), [12_000, 10_000]);
  replay.close();
});
