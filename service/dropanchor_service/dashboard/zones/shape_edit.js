/** Change the shape of a zone by its handles: corners and edges of a polygon, centre and radius of a circle. */

/** @typedef {import("./zone_store.js").Shape} Shape */
/** @typedef {{kind: "corner" | "edge" | "centre" | "radius", index: number, x: number, y: number}} Handle */

export const MAX_CORNERS = 200;
const MIN_RADIUS_M = 0.1;

/** @param {number} metres */
const toCentimetre = (metres) => Math.round(metres * 100) / 100;

/** Return the handles. Edges have theirs in the middle, once the polygon is closed. @param {Shape} shape @returns {Handle[]} */
export function handlesOf(shape) {
  if (shape.type === "circle") {
    const { x, y, radius_m } = shape;
    return [{ kind: "centre", index: 0, x, y }, { kind: "radius", index: 0, x: x + radius_m, y }];
  }
  const { points } = shape;
  /** @type {Handle[]} */
  const corners = points.map(([x, y], index) => ({ kind: "corner", index, x, y }));
  if (points.length < 3 || points.length >= MAX_CORNERS) return corners;
  return [...corners, ...points.map(([x, y], index) => {
    const [nextX, nextY] = points[(index + 1) % points.length];
    return /** @type {Handle} */ ({ kind: "edge", index, x: (x + nextX) / 2, y: (y + nextY) / 2 });
  })];
}

/** Return the shape with a handle at another place. An edge becomes two, with a new corner there.
 * @param {Shape} shape @param {Pick<Handle, "kind" | "index">} handle @param {number} x @param {number} y @returns {Shape} */
export function movedTo(shape, { kind, index }, x, y) {
  /** @type {[number, number]} */
  const place = [toCentimetre(x), toCentimetre(y)];
  if (shape.type === "polygon") {
    const points = kind === "edge" ? shape.points.toSpliced(index + 1, 0, place) : shape.points.with(index, place);
    return { ...shape, points };
  }
  if (kind === "centre") return { ...shape, x: place[0], y: place[1] };
  return { ...shape, radius_m: Math.max(MIN_RADIUS_M, toCentimetre(Math.hypot(x - shape.x, y - shape.y))) };
}

/** Return the polygon with one more corner. @param {Shape} shape @param {number} x @param {number} y @returns {Shape} */
export function withCorner(shape, x, y) {
  if (shape.type !== "polygon" || shape.points.length >= MAX_CORNERS) return shape;
  return { ...shape, points: [...shape.points, [toCentimetre(x), toCentimetre(y)]] };
}

/** Return the polygon without a corner. @param {Shape} shape @param {number} index @returns {Shape} */
export function withoutCorner(shape, index) {
  return shape.type === "polygon" ? { ...shape, points: shape.points.toSpliced(index, 1) } : shape;
}

/** Return the place that a refusal names; null: it names none.
 * @param {import("../i18n/said.js").Problem} problem @returns {[number, number] | null} */
export function placeIn({ detail_phrase }) {
  const [x, y] = detail_phrase?.values["what.place"]?.split(", ").map(Number) ?? [];
  return Number.isFinite(x) && Number.isFinite(y) ? [x, y] : null;
}

/** Return whether a place is in a zone. A height that is not known is in all of them. @param {import("./zone_store.js").Zone} zone
 * @param {number} x @param {number} y @param {number} z NaN: not known */
export function isInside({ shape, z_min_m, z_max_m }, x, y, z) {
  if (z < (z_min_m ?? -Infinity) || z > (z_max_m ?? Infinity)) return false;
  if (shape.type === "circle") return Math.hypot(x - shape.x, y - shape.y) <= shape.radius_m;
  const { points } = shape;
  const crossed = points.filter(([x1, y1], i) => {
    const [x2, y2] = points[(i + 1) % points.length];
    return y1 > y !== y2 > y && x < x1 + ((y - y1) * (x2 - x1)) / (y2 - y1);
  });
  return crossed.length % 2 === 1;
}
