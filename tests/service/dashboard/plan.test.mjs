import assert from "node:assert/strict";
import { test } from "node:test";

import { floorsOf, isElsewhere } from "../../../service/dropanchor_service/dashboard/plan/floors.js";
import { latLonIn } from "../../../service/dropanchor_service/dashboard/plan/geodesy.js";
import { aligned, cornersOf, isInside, pixelOf, residuals, siteOf } from "../../../service/dropanchor_service/dashboard/plan/transform.js";
import { isWorldFile, worldOf } from "../../../service/dropanchor_service/dashboard/plan/world_file.js";

const SIZE = { width_px: 400, height_px: 200 };
const PLACEMENT = { x: 3, y: -2, rotation_rad: 0.4, m_per_px: 0.05 };
const START = { x: 0, y: 0, rotation_rad: 0, m_per_px: 1 };

/** @param {number} a @param {number} b */
const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-9, `${a} is not ${b}`);

/** @param {[number, number][]} pixels */
const seenAt = (pixels) => pixels.map(([column_px, row_px]) => {
  const [x, y] = siteOf(PLACEMENT, SIZE, { column_px, row_px });
  return { column_px, row_px, x, y };
});

test("without a turn, columns go to the right and rows go down", () => {
  assert.deepEqual(cornersOf(START, SIZE), [[-200, 100], [200, 100], [200, -100], [-200, -100]]);
});

test("a pixel is found again at its place", () => {
  const { column_px, row_px } = pixelOf(PLACEMENT, SIZE, ...siteOf(PLACEMENT, SIZE, { column_px: 30, row_px: 170 }));
  near(column_px, 30);
  near(row_px, 170);
  assert.ok(isInside(SIZE, { column_px, row_px }));
  assert.ok(!isInside(SIZE, { column_px: 401, row_px }));
});

for (const pixels of /** @type {[number, number][][]} */ ([[[10, 10], [390, 180]], [[10, 10], [390, 180], [20, 150], [200, 5]]])) {
  test(`${pixels.length} exact points give the placement back`, () => {
    const points = seenAt(pixels);
    const found = aligned(START, SIZE, [...points, { column_px: 0, row_px: 0, x: null, y: null }], null);
    for (const key of /** @type {const} */ (["x", "y", "rotation_rad", "m_per_px"])) near(found[key], PLACEMENT[key]);
    for (const off of residuals(found, SIZE, points)) near(/** @type {number} */ (off), 0);
  });
}

test("one point only moves the plan, and a distance to a second scales it", () => {
  const points = [{ column_px: 100, row_px: 100, x: 5, y: 6 }, { column_px: 300, row_px: 100, x: null, y: null }];
  const moved = aligned(START, SIZE, points, null);
  assert.deepEqual([moved.m_per_px, moved.rotation_rad, ...siteOf(moved, SIZE, points[0])], [1, 0, 5, 6]);
  const scaled = aligned(START, SIZE, points, 20);
  near(scaled.m_per_px, 0.1);
  assert.deepEqual(siteOf(scaled, SIZE, points[0]), [5, 6]);
});

test("points that say nothing about the scale leave the plan as it is", () => {
  const same = { column_px: 7, row_px: 7, x: 1, y: 1 };
  assert.deepEqual(aligned(START, SIZE, [same, { ...same, x: 2 }], null), START);
  assert.deepEqual(aligned(START, SIZE, [same, { ...same, column_px: 9 }], null), START);
  assert.deepEqual(aligned(START, SIZE, [], null), START);
});

test("latitude and longitude are read from what maps copy", () => {
  assert.deepEqual(latLonIn(" 52.5163, 13.3777 "), { lat: 52.5163, lon: 13.3777 });
  assert.deepEqual(latLonIn("-33.9° 151"), { lat: -33.9, lon: 151 });
  for (const text of ["", "52.5", "91, 0", "north, east", "1, 2, 3"]) assert.equal(latLonIn(text), null, text);
});

/** @param {string} name @param {number} bottom_m @param {number} top_m @returns {any} */
const onFloor = (name, bottom_m, top_m) => ({ floor: { name, bottom_m, top_m } });

test("floors are listed from the top, and plans of one floor are joined", () => {
  const floors = floorsOf([onFloor("0", -1, 3), onFloor("1", 3, 6), onFloor("0", 3.5, 4), /** @type {any} */ ({ floor: null })]);
  assert.deepEqual(floors.map(({ name }) => name), ["1", "0"]);
  assert.deepEqual(floors[1].ranges, [[-1, 3], [3.5, 4]]);
});

test("a tag is elsewhere unless it is on the chosen floor with a probability above 0.9, or on no known floor", () => {
  const [upper] = floorsOf([onFloor("0", -1, 3), onFloor("1", 3, 6)]);
  assert.equal(isElsewhere(upper, "0", 0.99), true);
  assert.equal(isElsewhere(upper, "1", 0.91), false);
  assert.equal(isElsewhere(upper, "1", 0.9), true);
  assert.equal(isElsewhere(upper, null, NaN), false); // its height is not known, or on no floor
  assert.equal(isElsewhere(null, "0", 0.99), false);
});

test("a world file is known by its name and must hold six numbers", async () => {
  assert.ok(isWorldFile("hall.PGW") && isWorldFile("hall.tfw") && !isWorldFile("hall.png"));
  assert.equal(await worldOf(new File(["0.1\r\n0\n0\n-0.1\n5\n8e2\n"], "a.pgw")), "0.1,0,0,-0.1,5,800");
  await assert.rejects(worldOf(new File(["0.1 0 0"], "a.pgw")), /six numbers/);
});
