import assert from "node:assert/strict";
import { test } from "node:test";

import { Scale, hottest, leftOut } from "../../../service/dropanchor_service/dashboard/data/heat_map.js";
import { heatColour } from "../../../service/dropanchor_service/dashboard/map/draw_heat_map.js";

/** @param {number} share @param {boolean} isDark @returns {number} 0 black to 1 white, of the colour on the map */
function lightness(share, isDark) {
  const [red, green, blue, alpha] = (heatColour(share, isDark).match(/[\d.]+/g) ?? []).map(Number);
  const map = isDark ? 20 : 252;
  const on = (/** @type {number} */ value) => ((alpha * value + (1 - alpha) * map) / 255) ** 2.2;
  return 0.2126 * on(red) + 0.7152 * on(green) + 0.0722 * on(blue);
}

test("more time is always further from the colour of the map, without any hue", () => {
  for (const isDark of [false, true]) {
    const steps = Array.from({ length: 24 }, (_, i) => lightness(i / 23, isDark) * (isDark ? 1 : -1));
    steps.slice(1).forEach((value, i) => assert.ok(value > steps[i], `${isDark} ${i} ${steps[i]} ${value}`));
  }
});

test("the scale is logarithmic and ends a thousandth below the most", () => {
  const scale = new Scale([0.001, 10, 1000]);
  assert.deepEqual([0.001, 1, 1000].map((seconds) => scale.of(seconds)), [0, 0, 1]);
  assert.ok(Math.abs(scale.of(10) - 1 / 3) < 1e-9);
  assert.ok(Math.abs(scale.marks[1] - Math.sqrt(1000)) < 1e-9);
  assert.equal(new Scale([5, 5]).of(5), 1);
});

test("what is left out is a share of all time with poses", () => {
  const heat = { tags: 1, cell_m: 1, placed_s: 60, left_out_s: 20, cells: { x: [0, 1], y: [0, 0], seconds: [20, 40] } };
  assert.equal(leftOut(heat), 0.25);
  assert.equal(hottest(heat), 1);
  assert.equal(hottest({ ...heat, cells: { x: [], y: [], seconds: [] } }), -1);
});
