/** Web Mercator and the frame of the site. Around the middle of the view, one is an affine image of the other.
 *
 * Mercator coordinates are those of the tile at zoom 0: 0 to 1 from west to east and from north to south. The affine map
 * is exact in the middle. Its error at the edge of a view is about width² · tan(latitude) / (8 · radius of the Earth):
 * 0.3 mm in a view of 100 m at a latitude of 52°, 3 cm in one of 1 km, and less than a pixel in one of 20 km.
 */

import { siteOfLatLon } from "../plan/geodesy.js";

/** @typedef {import("../plan/geodesy.js").Georeference} Georeference */
/** @typedef {import("../map/view.js").Bounds} Bounds */
/** @typedef {{z: number, x: number, y: number}} TileId */
/** @typedef {{west: number, south: number, east: number, north: number}} World the part of the world that a map shows, degrees */
/**
 * @typedef {object} Affine x = at.x + a · (mx − at.mx) + c · (my − at.my), y = at.y + b · (mx − at.mx) + d · (my − at.my)
 * @property {{x: number, y: number, mx: number, my: number}} at
 * @property {number} a @property {number} b @property {number} c @property {number} d
 */

const RAD = Math.PI / 180;
const MAX_LAT = 85;
const STEP = 1e-6; // 40 m at the equator
const ITERATIONS = 3;

/** @param {{lat: number, lon: number}} place @returns {[number, number]} */
export function mercatorOf({ lat, lon }) {
  return [lon / 360 + 0.5, 0.5 - Math.atanh(Math.sin(lat * RAD)) / (2 * Math.PI)];
}

/** @param {number} mx @param {number} my */
export function latLonOf(mx, my) {
  return { lat: Math.atan(Math.sinh(Math.PI * (1 - 2 * my))) / RAD, lon: (mx - 0.5) * 360 };
}

/** Return the map that is exact at a place of the site; null near the poles, where web Mercator ends.
 * @param {Georeference} origin @param {number} x m @param {number} y m @returns {Affine | null} */
export function affineAt(origin, x, y) {
  if (Math.abs(origin.lat) > MAX_LAT) return null;
  let [mx, my] = mercatorOf(origin);
  let found = tangentAt(origin, mx, my);
  for (let i = 0; i < ITERATIONS; i++) {
    [mx, my] = mercatorAt(found, x, y);
    found = tangentAt(origin, mx, my);
  }
  return Number.isFinite(found.a + found.d + found.at.x) ? found : null;
}

/** @param {Georeference} origin @param {number} mx @param {number} my @returns {Affine} */
function tangentAt(origin, mx, my) {
  const place = (/** @type {number} */ dx, /** @type {number} */ dy) => siteOfLatLon(origin, latLonOf(mx + dx, my + dy));
  const [x, y] = place(0, 0);
  const [west, east, north, south] = [place(-STEP, 0), place(STEP, 0), place(0, -STEP), place(0, STEP)];
  const slope = (/** @type {number[]} */ from, /** @type {number[]} */ to, /** @type {number} */ i) => (to[i] - from[i]) / (2 * STEP);
  return { at: { x, y, mx, my }, a: slope(west, east, 0), b: slope(west, east, 1), c: slope(north, south, 0), d: slope(north, south, 1) };
}

/** @param {Affine} affine @param {number} x @param {number} y @returns {[number, number]} */
export function mercatorAt({ at, a, b, c, d }, x, y) {
  const [dx, dy, determinant] = [x - at.x, y - at.y, a * d - b * c];
  return [at.mx + (d * dx - c * dy) / determinant, at.my + (a * dy - b * dx) / determinant];
}

/** @param {Affine} affine @param {number} mx @param {number} my @returns {[number, number]} */
export function siteAt({ at, a, b, c, d }, mx, my) {
  return [at.x + a * (mx - at.mx) + c * (my - at.my), at.y + b * (mx - at.mx) + d * (my - at.my)];
}

/** Return the length of an edge of the tile at zoom 0 on the ground here, m. @param {Affine} affine */
export const edgeOf = ({ a, b }) => Math.hypot(a, b);

/** Return the tiles of a map at a zoom level that reach into a part of the site; null: there are more than `most`.
 * @param {Affine} affine @param {Bounds} bounds @param {World} world @param {number} z @param {number} most @returns {TileId[] | null} */
export function tilesIn(affine, bounds, world, z, most) {
  const { left, right, bottom, top } = bounds;
  const corners = [[left, bottom], [left, top], [right, bottom], [right, top]].map(([x, y]) => mercatorAt(affine, x, y));
  const size = 2 ** z;
  const limits = mercatorBounds(world);
  const [columns, lines] = [0, 1].map((axis) => {
    const values = corners.map((corner) => corner[axis]);
    const [first, last] = [Math.max(limits[axis][0], Math.min(...values)), Math.min(limits[axis][1], Math.max(...values))];
    return { first: Math.floor(first * size), last: Math.ceil(last * size) - 1 };
  });
  if (Math.max(0, columns.last - columns.first + 1) * Math.max(0, lines.last - lines.first + 1) > 4 * most) return null;
  const found = [];
  for (let y = lines.first; y <= lines.last; y++) {
    for (let x = columns.first; x <= columns.last; x++) if (reaches(affine, { z, x, y }, bounds)) found.push({ z, x, y });
  }
  return found.length > most ? null : found;
}

/** Return the least and the largest Mercator coordinate of a map, first from west to east, then from north to south. A map of
 * all longitudes has no end: the number of a column repeats around the Earth. @param {World} world */
function mercatorBounds({ west, south, east, north }) {
  const [[left, top], [right, bottom]] = [
    mercatorOf({ lat: Math.min(MAX_LAT, north), lon: west }), mercatorOf({ lat: Math.max(-MAX_LAT, south), lon: east }),
  ];
  return [right - left >= 1 ? [-Infinity, Infinity] : [left, right], [top, bottom]];
}

/** @param {Affine} affine @param {TileId} tile @param {Bounds} bounds */
function reaches(affine, { z, x, y }, { left, right, bottom, top }) {
  const size = 2 ** z;
  const corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(([u, v]) => siteAt(affine, (x + u) / size, (y + v) / size));
  const [xs, ys] = [0, 1].map((axis) => corners.map((corner) => corner[axis]));
  return Math.max(...xs) > left && Math.min(...xs) < right && Math.max(...ys) > bottom && Math.min(...ys) < top;
}
