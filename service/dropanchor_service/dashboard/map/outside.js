/** Find the tags that lie beside the visible part of the map. */

/** @typedef {import("./view.js").Bounds} Bounds @typedef {"left" | "right" | "up" | "down"} Side */
/** @typedef {{count: number, bounds: Bounds}} Group tags, and the bounds around them */

/**
 * Return the tags that are not visible, by the side on which they are; one beyond a corner is on the side of which it is farther.
 * @param {import("../data/fleet.js").Fleet} fleet @param {Bounds} seen @param {(row: number) => boolean} wanted
 * @returns {Map<Side, Group>}
 */
export function tagsOutside(fleet, seen, wanted) {
  /** @type {Map<Side, Group>} */
  const groups = new Map();
  for (let row = 0; row < fleet.size; row++) {
    const [x, y] = [fleet.drawnX[row], fleet.drawnY[row]];
    const side = sideOf(x, y, seen);
    if (side !== null && wanted(row)) addTo(groups, side, x, y);
  }
  return groups;
}

/** Return on which side of the bounds a place is; null inside, or without a place. @param {number} x @param {number} y @param {Bounds} seen
 * @returns {Side | null} */
export function sideOf(x, y, seen) {
  const across = x < seen.left ? seen.left - x : Math.max(0, x - seen.right);
  const along = y < seen.bottom ? seen.bottom - y : Math.max(0, y - seen.top);
  if (!(across > 0 || along > 0)) return null;
  if (across >= along) return x < seen.left ? "left" : "right";
  return y < seen.bottom ? "down" : "up";
}

/** Return the bounds around two others. @param {Bounds} a @param {Bounds} b @returns {Bounds} */
export const union = (a, b) => ({
  left: Math.min(a.left, b.left), right: Math.max(a.right, b.right), bottom: Math.min(a.bottom, b.bottom), top: Math.max(a.top, b.top),
});

/** @param {Map<Side, Group>} groups @param {Side} side @param {number} x @param {number} y */
function addTo(groups, side, x, y) {
  const bounds = { left: x, right: x, bottom: y, top: y };
  const group = groups.get(side);
  if (!group) groups.set(side, { count: 1, bounds });
  else groups.set(side, { count: group.count + 1, bounds: union(group.bounds, bounds) });
}
