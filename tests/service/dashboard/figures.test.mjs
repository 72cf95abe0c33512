import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.location = /** @type {any} */ ({ search: "", hash: "" });
globalThis.sessionStorage = /** @type {any} */ ({ getItem: () => null });
globalThis.document = /** @type {any} */ ({ baseURI: "http://site/" });
const { linesOf, ordered, urlOf } = await import("../../../service/dropanchor_service/dashboard/data/figures.js");
const { duration } = await import("../../../service/dropanchor_service/dashboard/data/format.js");

const tag = (/** @type {string} */ name, /** @type {number} */ metres, /** @type {Record<string, number>} */ inside = {}) => ({
  tag: name, tracked_s: 60, distance_m: metres, mean_speed_mps: metres ? metres / 60 : null, max_speed_mps: null,
  zones: Object.entries(inside).map(([zone, inside_s]) => ({ zone, inside_s, stays: 1 })),
});
const figures = {
  zones: [{ zone: "dock", name: "Loading dock" }, { zone: "gate", name: null }],
  tags: [tag("tag-10", 0, { gate: 7 }), tag("tag-2", 30, { dock: 5 }), tag("tag-1", 30)],
};

test("a line has a value for each figure and each zone, and no time where a tag never was", () => {
  assert.deepEqual(linesOf(figures).map(({ values }) => values), [
    [60, 0, null, null, 0, 7], [60, 30, 0.5, null, 5, 0], [60, 30, 0.5, null, 0, 0],
  ]);
});

test("lines are ordered by name as people count, or by the largest value with the unknown last", () => {
  const names = (/** @type {number} */ column) => ordered(linesOf(figures), column).map((line) => line.tag);
  assert.deepEqual(names(-1), ["tag-1", "tag-2", "tag-10"]);
  assert.deepEqual(names(5), ["tag-10", "tag-1", "tag-2"]);
  assert.deepEqual(names(2), ["tag-1", "tag-2", "tag-10"]);
});

test("the file has the period and the group of the table", () => {
  const url = urlOf({ from_ms: 1000, to_ms: 2000, group: "carts & co" }, "csv");
  assert.deepEqual(Object.fromEntries(url.searchParams), { from: "1000000000", to: "2000000000", format: "csv", group: "carts & co" });
});

test("durations are hours, minutes and seconds", () => {
  assert.deepEqual([0, 59.6, 3909, 360000].map(duration), ["0:00:00", "0:01:00", "1:05:09", "100:00:00"]);
});
