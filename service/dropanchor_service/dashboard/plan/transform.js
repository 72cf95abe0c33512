/** Where the pixels of a plan lie in the site frame: a similarity, which moves, turns and scales. */

import { toCentimetre } from "../setup/gestures.js";

/** Share of the map that a new plan takes. */
const NEW_SHARE = 0.6;

/** @typedef {{x: number, y: number, rotation_rad: number, m_per_px: number}} Placement of the centre of the image */
/** @typedef {{width_px: number, height_px: number}} Size */
/** @typedef {{column_px: number, row_px: number}} Pixel */
/** @typedef {Pixel & {x: number | null, y: number | null}} Point a place on the plan, and where it is, as far as known */
/** @typedef {Pixel & {x: number, y: number}} PlacedPoint */

/** @param {Point} point @returns {point is PlacedPoint} */
export const isPlaced = (point) => point.x !== null && point.y !== null;

/** Return where a pixel lies. @param {Placement} placement @param {Size} size @param {Pixel} pixel @returns {[number, number]} */
export function siteOf({ x, y, rotation_rad, m_per_px }, size, pixel) {
  const [right, up] = fromCentre(size, pixel);
  const [cos, sin] = [m_per_px * Math.cos(rotation_rad), m_per_px * Math.sin(rotation_rad)];
  return [x + cos * right - sin * up, y + sin * right + cos * up];
}

/** Return the pixel at a place. @param {Placement} placement @param {Size} size @param {number} x @param {number} y @returns {Pixel} */
export function pixelOf(placement, { width_px, height_px }, x, y) {
  const [dx, dy] = [(x - placement.x) / placement.m_per_px, (y - placement.y) / placement.m_per_px];
  const [cos, sin] = [Math.cos(placement.rotation_rad), Math.sin(placement.rotation_rad)];
  return { column_px: width_px / 2 + cos * dx + sin * dy, row_px: height_px / 2 - (cos * dy - sin * dx) };
}

/** @param {Size} size @param {Pixel} pixel */
export const isInside = (size, { column_px, row_px }) => column_px >= 0 && column_px <= size.width_px && row_px >= 0 && row_px <= size.height_px;

/** Return the placement of a new plan. @param {import("../map/view.js").View} view @param {Size} size @returns {Placement} */
export function inMiddleOf({ x, y, scale, width, height }, { width_px, height_px }) {
  const m_per_px = (NEW_SHARE / scale) * Math.min(width / width_px, height / height_px);
  return { x: toCentimetre(x), y: toCentimetre(y), rotation_rad: 0, m_per_px };
}

/** Return the corners, from the first pixel clockwise. @param {Placement} placement @param {Size} size @returns {[number, number][]} */
export function cornersOf(placement, size) {
  const { width_px: w, height_px: h } = size;
  return [[0, 0], [w, 0], [w, h], [0, h]].map(([column_px, row_px]) => siteOf(placement, size, { column_px, row_px }));
}

/**
 * Return the placement that fits the points with the least squared error. One point only moves the plan. With the distance
 * between two points, of which one is placed, the plan is scaled, too.
 * @param {Placement} placement as it is now @param {Size} size @param {readonly Point[]} points
 * @param {number | null} distance_m between the first two points
 * @returns {Placement}
 */
export function aligned(placement, size, points, distance_m) {
  const placed = points.filter(isPlaced);
  if (placed.length === 0) return placement;
  if (placed.length > 1) return fitted(placement, size, placed);
  const scaled = distance_m === null || points.length < 2 ? placement : { ...placement, m_per_px: distance_m / apart(points[0], points[1]) };
  if (!isUsable(scaled)) return placement;
  const [x, y] = siteOf(scaled, size, placed[0]);
  return { ...scaled, x: scaled.x + placed[0].x - x, y: scaled.y + placed[0].y - y };
}

/** @param {Placement} placement @param {Size} size @param {readonly PlacedPoint[]} points @returns {Placement} */
function fitted(placement, size, points) {
  const from = centred(points.map((point) => fromCentre(size, point)));
  const to = centred(points.map(({ x, y }) => /** @type {[number, number]} */ ([x, y])));
  let [along, across, square] = [0, 0, 0];
  from.vectors.forEach(([right, up], i) => {
    const [x, y] = to.vectors[i];
    along += right * x + up * y;
    across += right * y - up * x;
    square += right * right + up * up;
  });
  const found = { ...placement, rotation_rad: Math.atan2(across, along), m_per_px: Math.hypot(along, across) / square };
  if (!isUsable(found)) return placement;
  const [right, up] = from.mean;
  const pixel = { column_px: size.width_px / 2 + right, row_px: size.height_px / 2 - up };
  const [x, y] = siteOf({ ...found, x: 0, y: 0 }, size, pixel);
  return { ...found, x: to.mean[0] - x, y: to.mean[1] - y };
}

/** Return how far each placed point lies from where the plan shows it, in m; null for the others.
 * @param {Placement} placement @param {Size} size @param {readonly Point[]} points */
export function residuals(placement, size, points) {
  return points.map((point) => {
    if (!isPlaced(point)) return null;
    const [x, y] = siteOf(placement, size, point);
    return Math.hypot(point.x - x, point.y - y);
  });
}

/** @param {Pixel} a @param {Pixel} b */
const apart = (a, b) => Math.hypot(a.column_px - b.column_px, a.row_px - b.row_px);

/** @param {Placement} placement */
const isUsable = ({ m_per_px }) => Number.isFinite(m_per_px) && m_per_px > 0;

/** Return pixels to the right of the centre and above it. @param {Size} size @param {Pixel} pixel @returns {[number, number]} */
const fromCentre = ({ width_px, height_px }, { column_px, row_px }) => [column_px - width_px / 2, height_px / 2 - row_px];

/** @param {[number, number][]} points @returns {{mean: [number, number], vectors: [number, number][]}} */
function centred(points) {
  const sum = points.reduce(([a, b], [x, y]) => [a + x, b + y], [0, 0]);
  const mean = /** @type {[number, number]} */ ([sum[0] / points.length, sum[1] / points.length]);
  return { mean, vectors: points.map(([x, y]) => [x - mean[0], y - mean[1]]) };
}
