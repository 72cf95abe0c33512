/** The contents of one drawing of the map. */

/**
 * @typedef {object} Scene
 * @property {CanvasRenderingContext2D} ctx
 * @property {import("./view.js").View} view
 * @property {import("./palette.js").Palette} palette
 * @property {import("../data/fleet.js").Fleet} fleet
 * @property {import("../data/trails.js").Trails} trails
 * @property {readonly import("./draw_site.js").Anchor[]} anchors
 * @property {import("../data/roster.js").Roster} roster
 * @property {Int32Array} rows visible tags
 * @property {number} selected row, or −1
 * @property {readonly number[]} chosen rows of the selected tags: none, one or several
 * @property {(row: number) => string} colourOf a selected tag
 * @property {number} hovered row, or −1
 * @property {number} now_ms
 */

/** Opacity of fresh, stale and old poses. Their contrast with the halo is at least 3 : 1. */
export const FADE = [1, 0.85, 0.72];

const MARGIN_PX = 24;

/**
 * Return the rows whose dots lie in the view.
 * @param {import("../data/fleet.js").Fleet} fleet
 * @param {import("./view.js").View} view
 * @param {(row: number) => boolean} wanted
 */
export function rowsInView(fleet, view, wanted) {
  const seen = view.bounds(MARGIN_PX);
  const rows = new Int32Array(fleet.size);
  let count = 0;
  for (let row = 0; row < fleet.size; row++) {
    const [x, y] = [fleet.drawnX[row], fleet.drawnY[row]];
    if (x >= seen.left && x <= seen.right && y >= seen.bottom && y <= seen.top && wanted(row)) rows[count++] = row;
  }
  return rows.subarray(0, count);
}

/**
 * Group the rows by state and staleness, since each group is drawn with one path.
 * @param {Scene} scene
 * @returns {{state: number, stale: 0 | 1 | 2, rows: number[]}[]}
 */
export function alike(scene) {
  /** @type {Map<number, {state: number, stale: 0 | 1 | 2, rows: number[]}>} */
  const groups = new Map();
  for (const row of scene.rows) {
    const state = scene.fleet.state[row];
    const stale = scene.fleet.staleness(row, scene.now_ms);
    let group = groups.get(3 * state + stale);
    if (!group) groups.set(3 * state + stale, (group = { state, stale, rows: [] }));
    group.rows.push(row);
  }
  return [...groups.values()];
}

/** Return the height of a tag, m: that of its pose, or else the told one. @param {import("../data/fleet.js").Fleet} fleet
 * @param {import("../data/roster.js").Roster} roster @param {number} row */
export const heightOf = ({ number, names }, roster, row) => (Number.isNaN(number.z[row]) ? roster.height(names[row]) : number.z[row]);

/** Return the tag nearest to a point on the screen and within `reach` pixels of it; −1: none.
 * @param {import("../data/fleet.js").Fleet} fleet @param {import("./view.js").View} view @param {Int32Array} rows
 * @param {number} px @param {number} py @param {number} reach */
export function nearest(fleet, view, rows, px, py, reach) {
  let [best, least] = [-1, reach * reach];
  for (const row of rows) {
    const dx = view.screenX(fleet.drawnX[row]) - px;
    const dy = view.screenY(fleet.drawnY[row]) - py;
    const squared = dx * dx + dy * dy;
    if (squared <= least) [best, least] = [row, squared];
  }
  return best;
}
