/** Distances on the map, in metres. */

/**
 * The distance on the map of a range measured through the air between two heights; 0 where the height explains it all.
 * @param {number} range @param {number} rise
 */
export function horizontal(range, rise) {
  return Math.sqrt(Math.max(0, range * range - rise * rise));
}

/**
 * The least and the greatest distance from a point to a rectangle.
 * @param {number} x @param {number} y
 * @param {import("./view.js").Bounds} bounds
 * @returns {[number, number]}
 */
export function distancesTo(x, y, bounds) {
  const nearX = Math.max(bounds.left - x, 0, x - bounds.right);
  const nearY = Math.max(bounds.bottom - y, 0, y - bounds.top);
  const farX = Math.max(Math.abs(bounds.left - x), Math.abs(bounds.right - x));
  const farY = Math.max(Math.abs(bounds.bottom - y), Math.abs(bounds.top - y));
  return [Math.hypot(nearX, nearY), Math.hypot(farX, farY)];
}
