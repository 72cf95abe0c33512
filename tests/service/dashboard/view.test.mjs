import assert from "node:assert/strict";
import { test } from "node:test";

import { MAX_SCALE, View, boundsAround, multiples, roundStep } from "../../../service/dropanchor_service/dashboard/map/view.js";

function view() {
  return Object.assign(new View(), { x: 3, y: -2, scale: 50, width: 800, height: 600 });
}

test("north is up and east is right", () => {
  const seen = view();
  assert.ok(seen.screenX(4) > seen.screenX(3));
  assert.ok(seen.screenY(1) < seen.screenY(0));
});

test("converting to the screen and back gives the same point", () => {
  const seen = view();
  assert.ok(Math.abs(seen.worldX(seen.screenX(7.25)) - 7.25) < 1e-12);
  assert.ok(Math.abs(seen.worldY(seen.screenY(-4.5)) + 4.5) < 1e-12);
});

test("zooming keeps the point under the pointer", () => {
  const seen = view();
  const [x, y] = [seen.worldX(120), seen.worldY(480)];
  seen.zoomAt(2.5, 120, 480);
  assert.equal(seen.scale, 125);
  assert.ok(Math.abs(seen.worldX(120) - x) < 1e-12);
  assert.ok(Math.abs(seen.worldY(480) - y) < 1e-12);
});

test("zooming stops at a limit without a drift of the view", () => {
  const seen = view();
  seen.zoomAt(1e9, 400, 300);
  assert.equal(seen.scale, MAX_SCALE);
  assert.equal(seen.x, 3);
});

test("panning moves the world with the pointer", () => {
  const seen = view();
  const [x, y] = [seen.worldX(100), seen.worldY(100)];
  seen.pan(30, -20);
  assert.ok(Math.abs(seen.worldX(130) - x) < 1e-12);
  assert.ok(Math.abs(seen.worldY(80) - y) < 1e-12);
});

test("a fitted view keeps its padding", () => {
  const seen = view();
  Object.assign(seen, seen.fitted({ left: -10, right: 30, bottom: 5, top: 9 }, 60));
  assert.ok(Math.abs(seen.screenX(-10) - 60) < 1e-9);
  assert.ok(Math.abs(seen.screenX(30) - 740) < 1e-9);
  assert.ok(seen.screenY(9) >= 60 && seen.screenY(5) <= 540);
});

test("a fitted view leaves the buttons free", () => {
  const seen = Object.assign(view(), { covered: 100 });
  Object.assign(seen, seen.fitted({ left: -10, right: 30, bottom: 5, top: 9 }, 60));
  assert.ok(Math.abs(seen.screenX(-10) - 60) < 1e-9);
  assert.ok(Math.abs(seen.screenX(30) - 640) < 1e-9);
  assert.ok(Math.abs(seen.screenX(seen.free(60).right) - 640) < 1e-9);
});

test("bounds ignore unknown positions and have a minimum size", () => {
  assert.equal(boundsAround([[NaN, NaN]], 4), null);
  assert.deepEqual(boundsAround([[1, 1], [NaN, 90]], 4), { left: -1, right: 3, bottom: -1, top: 3 });
  assert.deepEqual(boundsAround([[0, 0], [10, 1]], 4), { left: 0, right: 10, bottom: -1.5, top: 2.5 });
});

test("steps are 1, 2 or 5 times a power of ten", () => {
  const steps = [[0.7, 1], [1, 1], [1.01, 2], [3, 5], [5.5, 10], [0.03, 0.05], [230, 500], [0.1, 0.1]];
  for (const [least, step] of steps) assert.ok(Math.abs(roundStep(least) - step) < 1e-12, `${least}`);
});

test("multiples include both ends", () => {
  assert.deepEqual(multiples(-2, 4, 2), [-2, 0, 2, 4]);
  assert.deepEqual(multiples(0.1, 0.3, 1), []);
});
