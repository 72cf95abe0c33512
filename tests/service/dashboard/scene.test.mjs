import assert from "node:assert/strict";
import { test } from "node:test";

import { countCells } from "../../../service/dropanchor_service/dashboard/map/density.js";
import { Fleet } from "../../../service/dropanchor_service/dashboard/data/fleet.js";
import { follow } from "../../../service/dropanchor_service/dashboard/data/motion.js";
import { sideOf, tagsOutside } from "../../../service/dropanchor_service/dashboard/map/outside.js";
import { alike, nearest, rowsInView } from "../../../service/dropanchor_service/dashboard/map/scene.js";
import { View } from "../../../service/dropanchor_service/dashboard/map/view.js";

const view = Object.assign(new View(), { x: 0, y: 0, scale: 10, width: 400, height: 400 });

/** @param {number[][]} places @param {string[]} [states] */
function fleetAt(places, states = places.map(() => "tracking")) {
  const fleet = new Fleet();
  const columns = { x: places.map(([x]) => x), y: places.map(([, y]) => y), state: states, age_s: places.map(() => 0) };
  fleet.apply(/** @type {any} */ ({ t_ns: 0, tags: places.map((_, i) => `${i}`), ...columns }), 0);
  follow(fleet, 0, false);
  return fleet;
}

/** @param {Fleet} fleet @param {number} [now_ms] @returns {any} */
const scene = (fleet, now_ms = 0) => ({ fleet, view, rows: rowsInView(fleet, view, () => true), now_ms });

test("only dots in the view are drawn, and none with an unknown position", () => {
  const fleet = fleetAt([[0, 0], [100, 0], [NaN, 0], [-19, 19]]);
  assert.deepEqual([...rowsInView(fleet, view, () => true)], [0, 3]);
  assert.deepEqual([...rowsInView(fleet, view, (row) => row !== 0)], [3]);
});

test("a click finds the nearest dot within reach", () => {
  const fleet = fleetAt([[0, 0], [1, 0]]);
  const rows = rowsInView(fleet, view, () => true);
  assert.equal(nearest(fleet, view, rows, 207, 200, 18), 1);
  assert.equal(nearest(fleet, view, rows, 204, 202, 18), 0);
  assert.equal(nearest(fleet, view, rows, 300, 300, 18), -1);
});

test("dots are grouped by state and staleness", () => {
  const groups = alike(scene(fleetAt([[0, 0], [1, 0], [2, 0]], ["tracking", "lost", "tracking"])));
  assert.deepEqual(groups.map(({ rows }) => rows), [[0, 2], [1]]);
  assert.deepEqual(alike(scene(fleetAt([[0, 0]]), 3000)).map(({ stale }) => stale), [1]);
});

test("every visible tag counts in one cell, and doubtful ones count separately", () => {
  const places = Array.from({ length: 600 }, (_, i) => [(i % 30) - 15, Math.floor(i / 30) - 10]);
  const cells = countCells(scene(fleetAt(places, places.map((_, i) => (i % 3 ? "tracking" : "degraded")))));
  const sum = (/** @type {Uint16Array} */ column) => column.reduce((total, count) => total + count, 0);
  assert.equal(sum(cells.total), 600);
  assert.equal(sum(cells.doubtful), 200);
  assert.equal(cells.max, Math.max(...cells.total));
});

test("an old pose is doubtful", () => {
  const cells = countCells(scene(fleetAt([[0, 0]]), 60_000));
  assert.deepEqual([...cells.doubtful].filter(Boolean), [1]);
});

test("tags outside the view are counted by side, without hidden ones and those with an unknown position", () => {
  const fleet = fleetAt([[0, 0], [-30, 5], [-40, 0], [25, 90], [NaN, 0], [22, -21]]);
  const groups = tagsOutside(fleet, view.bounds(), (row) => row !== 5);
  assert.deepEqual([...groups].map(([side, { count }]) => [side, count]), [["left", 2], ["up", 1]]);
  assert.deepEqual(groups.get("left")?.bounds, { left: -40, right: -30, bottom: 0, top: 5 });
  assert.equal(sideOf(22, -21, view.bounds()), "right");
  assert.equal(sideOf(21, -22, view.bounds()), "down");
});
