import assert from "node:assert/strict";
import { test } from "node:test";

import { standIns, tilesFor } from "../../../service/dropanchor_service/dashboard/basemap/coverage.js";
import { affineAt, edgeOf, latLonOf, mercatorAt, mercatorOf, siteAt, tilesIn } from "../../../service/dropanchor_service/dashboard/basemap/mercator.js";
import { styleOf, widthOf } from "../../../service/dropanchor_service/dashboard/basemap/style.js";
import { featuresOf, LINE, POLYGON, trace } from "../../../service/dropanchor_service/dashboard/basemap/vector_tile.js";
import { siteOfLatLon } from "../../../service/dropanchor_service/dashboard/plan/geodesy.js";

const BERLIN = { lat: 52.5163, lon: 13.3777, rotation_rad: 0.7 };
const WORLD = { west: -180, south: -90, east: 180, north: 90, min_zoom: 0, max_zoom: 22 };
const around = (/** @type {number} */ half, x = 0, y = 0) => ({ left: x - half, right: x + half, bottom: y - half, top: y + half });

/** @param {number} value @param {number} wanted @param {number} within */
const near = (value, wanted, within) => assert.ok(Math.abs(value - wanted) <= within, `${value} is not ${wanted} ± ${within}`);

test("a place has the numbers of its tile", () => {
  const [mx, my] = mercatorOf(BERLIN); // the tile of the Brandenburg Gate, as OpenStreetMap numbers it
  assert.deepEqual([Math.floor(mx * 2 ** 15), Math.floor(my * 2 ** 15)], [17601, 10746]);
  const { lat, lon } = latLonOf(mx, my);
  near(lat, BERLIN.lat, 1e-12);
  near(lon, BERLIN.lon, 1e-12);
});

for (const [half, error_m] of [[50, 0.0004], [500, 0.035], [10_000, 14]]) {
  test(`in a view of ${2 * half} m, the affine map is less than ${error_m} m off`, () => {
    for (const [x, y] of [[0, 0], [3000, -2000]]) {
      const affine = affineAt(BERLIN, x, y);
      assert.ok(affine);
      for (const [u, v] of [[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]]) {
        const [mx, my] = mercatorAt(affine, x + u * half, y + v * half);
        const [truly_x, truly_y] = siteOfLatLon(BERLIN, latLonOf(mx, my));
        const off = Math.hypot(truly_x - x - u * half, truly_y - y - v * half);
        assert.ok(off < (u === 0 && v === 0 ? 1e-6 : error_m), `${off} m`);
        siteAt(affine, mx, my).forEach((value, i) => near(value, [x + u * half, y + v * half][i], 1e-6));
      }
    }
  });
}

test("web Mercator ends before the poles", () => {
  assert.equal(affineAt({ lat: 89, lon: 0, rotation_rad: 0 }, 0, 0), null);
  assert.ok(affineAt({ lat: -84, lon: 179.9999, rotation_rad: 0 }, 100, 0));
});

test("the tiles of a view cover it, and no other tile is asked for", () => {
  const affine = affineAt(BERLIN, 0, 0);
  assert.ok(affine);
  const found = tilesIn(affine, around(400), WORLD, 17, 100) ?? [];
  const keys = new Set(found.map(({ x, y }) => `${x} ${y}`));
  for (let x = -400; x <= 400; x += 20) for (let y = -400; y <= 400; y += 20) {
    const [mx, my] = mercatorAt(affine, x, y);
    assert.ok(keys.has(`${Math.floor(mx * 2 ** 17)} ${Math.floor(my * 2 ** 17)}`));
  }
  const edge_m = edgeOf(affine) / 2 ** 17;
  assert.ok(found.length < (800 / edge_m + 2.5) ** 2, `${found.length} tiles`);
  assert.equal(tilesIn(affine, around(400), WORLD, 19, 10), null);
});

test("one zoom level suits the scale, within those of the map", () => {
  const affine = affineAt(BERLIN, 0, 0);
  assert.ok(affine);
  const zoomOf = (/** @type {number} */ scale, min_zoom = 0, max_zoom = 22) =>
    tilesFor(affine, around(400 / scale), scale, 256, { ...WORLD, min_zoom, max_zoom })[0]?.z;
  near((edgeOf(affine) / 2 ** (zoomOf(2) ?? 0)) * 2, 256, 256 * 0.42);
  assert.equal(zoomOf(4), (zoomOf(2) ?? 0) + 1);
  assert.equal(zoomOf(1000, 0, 15), 15);
  assert.equal(zoomOf(0.7), 16);
  assert.equal(zoomOf(0.7, 17, 19), 17);
  assert.equal(zoomOf(0.05, 17, 19), undefined);
  assert.equal(zoomOf(1, 18, 3), undefined);
});

test("a small map is shown however small it is, and nothing is asked for outside of it", () => {
  const affine = affineAt(BERLIN, 0, 0);
  assert.ok(affine);
  const [west, east, south, north] = [13.377, 13.379, 52.516, 52.517];
  const found = tilesFor(affine, around(20_000), 0.02, 256, { west, east, south, north, min_zoom: 17, max_zoom: 19 });
  const [[left, top], [right, bottom]] = [mercatorOf({ lat: north, lon: west }), mercatorOf({ lat: south, lon: east })];
  const columns = Math.floor(right * 2 ** 17) - Math.floor(left * 2 ** 17) + 1;
  const lines = Math.floor(bottom * 2 ** 17) - Math.floor(top * 2 ** 17) + 1;
  assert.equal(found.length, columns * lines);
  assert.deepEqual(tilesFor(affine, around(50, 5000, 0), 5, 256, { west, east, south, north, min_zoom: 17, max_zoom: 19 }), []);
});

test("a map of the world goes on beyond its edge", () => {
  const affine = affineAt({ lat: -17, lon: 179.9999, rotation_rad: 0 }, 0, 0);
  assert.ok(affine);
  const columns = (tilesIn(affine, around(400), WORLD, 17, 100) ?? []).map(({ x }) => x);
  assert.ok(Math.min(...columns) < 2 ** 17 && Math.max(...columns) >= 2 ** 17);
});

test("a view of very many tiles takes coarser ones, and the nearest comes first", () => {
  const affine = affineAt(BERLIN, 0, 0);
  assert.ok(affine);
  const wide = tilesFor(affine, around(2000), 2, 256, WORLD);
  assert.ok(wide.length > 16 && wide.length <= 64);
  const [mx, my] = mercatorAt(affine, 0, 0);
  assert.deepEqual([wide[0].x, wide[0].y], [mx, my].map((value) => Math.floor(value * 2 ** wide[0].z)));
});

test("a coarser tile stands in for one on its way, and for an image that is missing", () => {
  const entries = new Map(/** @type {[string, any][]} */ ([["3/4/2", "loading"], ["3/5/2", "missing"], ["2/2/1", "ready"], ["3/6/2", "failed"], ["1/1/0", "ready"]]));
  const find = (/** @type {import("../../../service/dropanchor_service/dashboard/basemap/mercator.js").TileId} */ { z, x, y }) => {
    return entries.get(`${z}/${x}/${y}`) ?? null;
  };
  const of = (/** @type {number[]} */ columns, isVector = false) =>
    standIns(columns.map((x) => ({ z: 3, x, y: 2 })), find, 1, isVector);
  assert.deepEqual(of([4]), { drawn: [{ z: 2, x: 2, y: 1 }], requested: [] });
  assert.deepEqual(of([4, 5]).drawn, [{ z: 2, x: 2, y: 1 }]);
  assert.deepEqual(of([5], true), { drawn: [], requested: [] });
  assert.deepEqual(of([7]), { drawn: [{ z: 1, x: 1, y: 0 }], requested: [{ z: 3, x: 7, y: 2 }] });
  entries.set("3/7/2", "missing");
  assert.deepEqual(of([7]), { drawn: [{ z: 1, x: 1, y: 0 }], requested: [{ z: 2, x: 3, y: 1 }] });
  assert.deepEqual(of([6]).requested, []);
});

/** @param {number[]} geometry @param {number} extent @param {number} type */
const drawn = (geometry, extent = 1, type = LINE) => {
  /** @type {(string | number)[][]} */
  const steps = [];
  const pen = {
    moveTo: (/** @type {number} */ x, /** @type {number} */ y) => steps.push(["M", x, y]),
    lineTo: (/** @type {number} */ x, /** @type {number} */ y) => steps.push(["L", x, y]),
    closePath: () => steps.push(["Z"]),
  };
  trace(pen, { layer: "", kind: "", type, extent, geometry: Uint8Array.from(geometry) });
  return steps;
};

test("lines are drawn as in the examples of the specification", () => {
  assert.deepEqual(drawn([9, 4, 4, 18, 0, 16, 16, 0]), [["M", 2, 2], ["L", 2, 10], ["L", 10, 10]]);
  assert.deepEqual(drawn([9, 4, 4, 18, 0, 16, 16, 0, 9, 17, 17, 10, 4, 8]), [
    ["M", 2, 2], ["L", 2, 10], ["L", 10, 10], ["M", 1, 1], ["L", 3, 5],
  ]);
  assert.deepEqual(drawn([9, 6, 12, 18, 10, 12, 24, 44, 15], 10, POLYGON), [["M", 0.3, 0.6], ["L", 0.8, 1.2], ["L", 2, 3.4], ["Z"]]);
});

/** @param {number} number @param {number[]} content */
const field = (number, content) => [number * 8 + 2, content.length, ...content];
const text = (/** @type {string} */ value) => [...new TextEncoder().encode(value)];
const FEATURE = field(2, [...field(2, [0, 0, 1, 1]), 3 * 8, 2, ...field(4, [9, 4, 4, 10, 0, 16])]);
const VALUES = [...field(4, [3 * 8 + 1, 0, 0, 0, 0, 0, 0, 0, 0]), ...field(4, field(1, text("path")))];
const LAYER = [15 * 8, 2, ...field(1, text("roads")), ...FEATURE, ...field(3, text("height")), ...field(3, text("kind")), ...VALUES, 5 * 8, 128, 32];

test("a feature has the layer, the kind and the type", () => {
  const [feature, ...others] = featuresOf(Uint8Array.from(field(3, LAYER)));
  assert.deepEqual({ ...feature, geometry: [...feature.geometry] }, { layer: "roads", kind: "path", type: 2, extent: 4096, geometry: [9, 4, 4, 10, 0, 16] });
  assert.deepEqual(others, []);
});

test("damaged tiles end with an error, whatever is cut off or changed", () => {
  const whole = field(3, LAYER);
  for (let length = 1; length < whole.length; length++) assert.throws(() => [...featuresOf(Uint8Array.from(whole.slice(0, length)))]);
  for (let at = 0; at < whole.length; at++) for (const value of [0, 7, 127, 128, 255]) {
    const changed = Uint8Array.from(whole);
    changed[at] = value;
    try {
      for (const feature of featuresOf(changed)) trace({ moveTo() {}, lineTo() {}, closePath() {} }, feature);
    } catch (error) {
      assert.ok(error instanceof Error);
    }
  }
  assert.throws(() => drawn([3]), /unknown command 3/);
  assert.throws(() => drawn([250, 255, 255, 255, 15, 0, 0]), /too early/);
});

test("layers of the usual schemas are drawn, and labels are not", () => {
  assert.equal(styleOf("water", "lake", POLYGON), "water");
  assert.equal(styleOf("waterway", "river", LINE), "stream");
  assert.equal(styleOf("buildings", "building", POLYGON), "building");
  assert.equal(styleOf("buildings", "address", 1), null);
  assert.equal(styleOf("landuse", "park", POLYGON), "green");
  assert.equal(styleOf("landuse", "parking", POLYGON), null);
  assert.equal(styleOf("park", "", POLYGON), "green");
  const roads = { highway: "major", major_road: "major", primary: "major", minor_road: "minor", service: "minor", path: "path", rail: "rail", ferry: null };
  for (const [kind, style] of Object.entries(roads)) for (const layer of ["roads", "transportation", "streets"]) assert.equal(styleOf(layer, kind, LINE), style);
  assert.equal(styleOf("transportation", "pedestrian", POLYGON), "paved");
  for (const layer of ["places", "boundary", "street_labels", "transportation_name", "earth"]) assert.equal(styleOf(layer, "", LINE), null);
  assert.equal(styleOf("fences", "", LINE), "other");
});

test("a road is as wide as on the ground, but never invisible", () => {
  const road = { colour: /** @type {const} */ ("base-road"), width_m: 6, least_px: 1.25 };
  assert.equal(widthOf(road, 10), 60);
  assert.equal(widthOf(road, 0.01), 1.25);
});

test("a thread that cannot run is replaced by the page: pictures that wait are painted, tiles that wait are requested again", async () => {
  /** @type {FailingWorker[]} */
  const workers = [];
  class FailingWorker extends EventTarget {
    ended = false;
    constructor() { super(); workers.push(this); }
    postMessage() {}
    terminate() { this.ended = true; }
  }
  const canvas = { width: 0, height: 0, getContext: () => ({}) };
  Object.assign(globalThis, {
    Worker: FailingWorker, OffscreenCanvas: class {}, document: { createElement: () => canvas },
    createImageBitmap: async (/** @type {any} */ from) => ({ picture: from.width }),
  });
  const { PaintingThread } = await import("../../../service/dropanchor_service/dashboard/basemap/thread.js");
  const thread = new PaintingThread();
  const painting = /** @type {any} */ ({ width: 7, height: 5, tiles: [], colours: { map: "#fff" } });
  const [read, painted] = [thread.read("1/0/0", "image/png", new ArrayBuffer(1)), thread.paint(painting)];
  workers[0].dispatchEvent(new Event("error"));
  assert.deepEqual([await read, await painted], [false, { picture: 7 }]);
  assert.deepEqual([await thread.read("1/0/0", "image/png", new ArrayBuffer(1)), workers.length, workers[0].ended], [true, 1, true]);
});
