/** Distances on the map, in metres. */

/**
 * Return the horizontal distance of a slant range; 0 where the difference in height is larger than the range.
 * @param {number} range @param {number} rise difference in height
 */
export function horizontal(range, rise) {
  return Math.sqrt(Math.max(0, range * range - rise * rise));
}

/**
 * Return the smallest and the largest distance from a point to a rectangle.
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

/**
 * Return how far an ellipse reaches to the right and up from its middle; 0 for none.
 * @param {number} major semi-axis @param {number} minor semi-axis @param {number} angle of the major axis, rad
 * @returns {[number, number]}
 */
export function reachOf(major, minor, angle) {
  if (!(major > 0)) return [0, 0];
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  return [Math.hypot(major * cos, minor * sin), Math.hypot(major * sin, minor * cos)];
}
