/** Choose where names stand on the map: beside their dots, clear of dots, anchors and each other, and where they stood before. */

/** @typedef {number[]} Box left, top, right, bottom, in pixels */
/** @typedef {{key: string, x: number, y: number, width: number, must: boolean, trusted: boolean}} Wanted a name beside (x, y); `must`: with or without room; `trusted`: whether the pose is good */

const HEIGHT_PX = 16;
const BESIDE_PX = 13;
/** A name that is shown may touch others a little before it moves, and a new one needs some room, so that none flickers. */
const KEEP_PX = 2;
const ROOM_PX = 3;
const CELL_PX = 64;
const MOST_NAMES = 80;

/** Return the boxes in which the name of a dot may stand, the best first. @param {Wanted} wanted @returns {Box[]} */
export function placesAround({ x, y, width }) {
  const [right, left] = [x + BESIDE_PX, x - BESIDE_PX - width];
  const places = [[right, y - 12], [right, y + 13], [left, y - 12], [left, y + 13], [right, y], [left, y], [x - width / 2, y - 20], [x - width / 2, y + 20]];
  return places.map(([from, middle]) => [from, middle - HEIGHT_PX / 2, from + width, middle + HEIGHT_PX / 2]);
}

export class LabelPlaces {
  /** The place of each name that is shown. @type {Map<string, number>} */
  #shown = new Map();

  /** Return the boxes of the names that have room. Names that must be shown come first, then those of tags in
   * trouble, and of all these the ones that were shown before.
   * @param {readonly Wanted[]} wanted @param {readonly Box[]} obstacles @param {Box} free the part of the map where names may stand
   * @returns {Map<string, Box>} */
  arrange(wanted, obstacles, free) {
    const taken = new Grid(obstacles);
    const before = this.#shown;
    this.#shown = new Map();
    /** @type {Map<string, Box>} */
    const boxes = new Map();
    const rank = (/** @type {Wanted} */ { key, must, trusted }) => (must ? 0 : trusted ? 3 : 1) + (before.has(key) ? 0 : 1);
    for (const one of [...wanted].sort((a, b) => rank(a) - rank(b))) {
      if (boxes.size >= MOST_NAMES) break;
      const box = this.#place(one, before.get(one.key), taken, free);
      if (!box) continue;
      taken.add(box);
      boxes.set(one.key, box);
    }
    return boxes;
  }

  /** @param {Wanted} wanted @param {number | undefined} before @param {Grid} taken @param {Box} free @returns {Box | null} */
  #place(wanted, before, taken, free) {
    const places = placesAround(wanted);
    const fits = (/** @type {number} */ place, /** @type {number} */ room) => isInside(places[place], free) && !taken.touches(grown(places[place], room));
    const kept = before !== undefined && fits(before, -KEEP_PX) ? before : places.findIndex((_, place) => fits(place, ROOM_PX));
    if (kept >= 0) this.#shown.set(wanted.key, kept);
    if (kept >= 0) return places[kept];
    return wanted.must ? movedInto(places[0], free) : null;
  }
}

/** Boxes by the squares of the map that they touch, so that a name is compared with its neighbours only. */
class Grid {
  /** @type {Map<number, Box[]>} */
  #cells = new Map();

  /** @param {readonly Box[]} boxes */
  constructor(boxes) {
    for (const box of boxes) this.add(box);
  }

  /** @param {Box} box */
  add(box) {
    for (const cell of cellsOf(box)) {
      const others = this.#cells.get(cell);
      if (others) others.push(box);
      else this.#cells.set(cell, [box]);
    }
  }

  /** @param {Box} box */
  touches(box) {
    return cellsOf(box).some((cell) => this.#cells.get(cell)?.some((other) => overlap(box, other)));
  }
}

/** @param {Box} box @returns {number[]} */
function cellsOf([left, top, right, bottom]) {
  const cells = [];
  for (let line = Math.floor(top / CELL_PX); line <= Math.floor(bottom / CELL_PX); line++) {
    for (let column = Math.floor(left / CELL_PX); column <= Math.floor(right / CELL_PX); column++) cells.push(line * 4096 + column);
  }
  return cells;
}

/** @param {Box} a @param {Box} b */
const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

/** @param {Box} box @param {number} by */
const grown = ([left, top, right, bottom], by) => [left - by, top - by, right + by, bottom + by];

/** @param {Box} box @param {Box} free */
const isInside = (box, free) => box[0] >= free[0] && box[1] >= free[1] && box[2] <= free[2] && box[3] <= free[3];

/** @param {Box} box @param {Box} free @returns {Box} */
function movedInto(box, free) {
  const [width, height] = [box[2] - box[0], box[3] - box[1]];
  const left = Math.max(free[0], Math.min(box[0], free[2] - width));
  const top = Math.max(free[1], Math.min(box[1], free[3] - height));
  return [left, top, left + width, top + height];
}
