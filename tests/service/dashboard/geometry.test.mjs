import assert from "node:assert/strict";
import { test } from "node:test";

import { distancesTo, horizontal, reachOf } from "../../../service/dropanchor_service/dashboard/map/geometry.js";

const square = { left: 0, right: 4, bottom: 0, top: 3 };

test("inside a rectangle the smallest distance is zero", () => {
  assert.deepEqual(distancesTo(0, 0, square), [0, 5]);
});

test("the distances from outside a rectangle are to its edge and to its far corner", () => {
  assert.deepEqual(distancesTo(-3, 7, square), [5, Math.hypot(7, 7)]);
  assert.deepEqual(distancesTo(2, -5, square), [5, Math.hypot(2, 8)]);
});

test("a slant range is longer than the horizontal distance", () => {
  assert.equal(horizontal(5, 3), 4);
  assert.equal(horizontal(5, -3), 4);
});

test("a range shorter than the height gives distance zero", () => {
  assert.equal(horizontal(2, 3), 0);
});

test("an ellipse reaches as far as its axes tell", () => {
  const close = (/** @type {number[]} */ found, /** @type {number[]} */ wanted) => found.forEach((value, i) => assert.ok(Math.abs(value - wanted[i]) < 1e-9, `${found}`));
  close(reachOf(3, 1, 0), [3, 1]);
  close(reachOf(3, 1, Math.PI / 2), [1, 3]);
  close(reachOf(3, 3, 0.7), [3, 3]);
  close(reachOf(NaN, NaN, 0), [0, 0]);
});
