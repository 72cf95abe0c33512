/** Draw very many tags as a grid of cells that are stronger the more tags they hold. */

import { STATES } from "../data/states.js";

export const DENSITY_ABOVE = 5000;
const CELL_PX = 8;

/**
 * @typedef {object} Cells
 * @property {number} columns
 * @property {number} lines
 * @property {Uint16Array} total tags per cell
 * @property {Uint16Array} doubtful tags per cell whose pose cannot be trusted
 * @property {number} max the largest total
 */

/** @param {import("./scene.js").Scene} scene @returns {Cells} */
export function countCells({ fleet, view, rows, now_ms }) {
  const columns = Math.ceil(view.width / CELL_PX);
  const lines = Math.ceil(view.height / CELL_PX);
  const total = new Uint16Array(columns * lines);
  const doubtful = new Uint16Array(columns * lines);
  let max = 0;
  for (const row of rows) {
    const column = Math.floor(view.screenX(fleet.drawnX[row]) / CELL_PX);
    const line = Math.floor(view.screenY(fleet.drawnY[row]) / CELL_PX);
    if (column < 0 || line < 0 || column >= columns || line >= lines) continue;
    const cell = line * columns + column;
    max = Math.max(max, ++total[cell]);
    if (!STATES[fleet.state[row]].trusted || fleet.staleness(row, now_ms)) doubtful[cell]++;
  }
  return { columns, lines, total, doubtful, max };
}

/** @param {import("./scene.js").Scene} scene */
export function drawDensity(scene) {
  const cells = countCells(scene);
  const small = Object.assign(document.createElement("canvas"), { width: cells.columns, height: cells.lines });
  const pen = /** @type {CanvasRenderingContext2D} */ (small.getContext("2d"));
  const image = pen.createImageData(cells.columns, cells.lines);
  const [good, doubtful] = [rgb(scene.palette.state[2]), rgb(scene.palette.state[4])];
  cells.total.forEach((total, cell) => {
    if (total === 0) return;
    const share = cells.doubtful[cell] / total;
    for (let channel = 0; channel < 3; channel++) {
      image.data[4 * cell + channel] = good[channel] + share * (doubtful[channel] - good[channel]);
    }
    image.data[4 * cell + 3] = 50 + (205 * Math.log1p(total)) / Math.log1p(cells.max);
  });
  pen.putImageData(image, 0, 0);
  scene.ctx.imageSmoothingEnabled = false;
  scene.ctx.drawImage(small, 0, 0, cells.columns * CELL_PX, cells.lines * CELL_PX);
}

/** @param {string} colour as #rrggbb @returns {number[]} */
const rgb = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
