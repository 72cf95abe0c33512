import assert from "node:assert/strict";
import { test } from "node:test";

import { legsOf, sentence } from "../../../service/dropanchor_service/dashboard/map/measure.js";

test("a leg has a length and a bearing clockwise from north", () => {
  assert.deepEqual(legsOf([[0, 0], [3, 4]]).map(({ length_m }) => length_m), [5]);
  assert.equal(sentence([[1, 1], [1, 3]], 0), "2.00 m, 0° N");
  assert.equal(sentence([[0, 0], [2, 0]], 0), "2.00 m, 90° E");
  assert.equal(sentence([[0, 0], [2, 0], [2, -1]], 0), "1.00 m, 180° S · 3.00 m in all");
});

test("on a turned site a bearing still counts from true north", () => {
  assert.equal(sentence([[0, 0], [2, 0]], Math.PI / 2), "2.00 m, 0° N");
});

test("before the second point a sentence says what to do", () => {
  assert.match(sentence([[0, 0]], 0), /Click two or more points/);
});
