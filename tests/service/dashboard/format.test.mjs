import assert from "node:assert/strict";
import { test } from "node:test";

import {
  age, compass, coordinate, distance, fixed, half, height, length, percent, tagCount, turnRate, words,
} from "../../../service/dropanchor_service/dashboard/data/format.js";

/** @param {(value: any) => string} format @param {[any, string][]} cases */
function gives(format, cases) {
  for (const [value, text] of cases) assert.equal(format(value), text);
}

test("every unknown value is a dash", () => {
  for (const format of [age, compass, coordinate, half, length, percent, turnRate]) {
    gives(format, [[NaN, "–"], [null, "–"], [undefined, "–"], [Infinity, "–"]]);
  }
});

test("numbers have a true minus sign and no negative zero", () => {
  assert.equal(fixed(-1.255, 1), "−1.3");
  assert.equal(fixed(-0.001, 2), "0.00");
});

test("coordinates lose decimals with distance", () => {
  gives(coordinate, [[-3.14159, "−3.14"], [123.456, "123.5"], [-9876.5, "−9877"]]);
});

test("a heading is shown clockwise from north, with its compass point", () => {
  gives(compass, [[0, "90° E"], [Math.PI / 2, "0° N"], [-Math.PI / 2, "180° S"], [Math.PI, "270° W"]]);
  gives(compass, [[(113 * Math.PI) / 180, "337° NNW"], [-Math.PI / 4, "135° SE"], [7 * Math.PI, "270° W"]]);
  gives(compass, [[Math.PI / 2 + 0.001, "0° N"], [Math.PI / 2 - 0.001, "0° N"], [Math.PI / 2 + 0.02, "359° N"]]);
});

test("a turn is to the left or to the right", () => {
  gives(turnRate, [[0.5, "29 °/s left"], [-0.5, "29 °/s right"], [0.001, "0 °/s"], [-0.001, "0 °/s"]]);
});

test("a share below one is never rounded up to 100 %", () => {
  gives(percent, [[0.624, "62 %"], [0.9996, "99.9 %"], [1, "100 %"], [0, "0 %"]]);
});

test("ages are shown in a suitable unit", () => {
  gives(age, [[-0.2, "0.0 s"], [0.34, "0.3 s"], [12.4, "12 s"], [120, "2 min"], [7200, "2 h"], [3 * 86400, "3 d"]]);
});

test("ring distances have no needless digits", () => {
  gives(distance, [[0.05, "5 cm"], [0.30000000000000004, "0.3 m"], [20, "20 m"], [2000, "2 km"], [1500, "1.5 km"]]);
});

test("a count of one has a singular noun", () => {
  assert.equal(tagCount(1), "1 tag");
  assert.equal(tagCount(12000), "12,000 tags");
  assert.equal(words("several_modes"), "several modes");
});

test("a height says where it comes from", () => {
  assert.equal(height(1.1, 0.15, "told"), "1.10 m, as told");
  assert.equal(height(11.234, 0.321, "pressure"), "11.23 m ± 0.32 m, from pressure");
  assert.equal(height(1.1, 10, "unknown"), "unknown: no pressures");
  assert.equal(height(NaN, NaN, null), "–");
});
