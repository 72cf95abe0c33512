/** Draw the dots, heading ticks and names of the tags. */

import { ago } from "../data/format.js";
import { SCALE_BAR_PX, haloStroke, haloText } from "./draw_site.js";
import { shortened } from "../data/names.js";
import { FADE, alike } from "./scene.js";
import { dashOf, isFilled, traceMarker } from "./shapes.js";
import { AMBIGUOUS, STATES } from "../data/states.js";

/** @typedef {import("./scene.js").Scene} Scene */

const LABELS_UP_TO = 80;
const TICK_PX = 9;
const ELSEWHERE_ALPHA = 0.45;
const RIM_PX = 3;
/** Dots in a crowd are small: their halo is thin, and their headings have none. */
const CROWD_RIM_PX = 1.25;

/** @param {number} count dots on the screen */
export const markerRadius = (count) => (count <= 200 ? 5.5 : count <= 1500 ? 4 : 3);

/** @param {number} radius */
const isCrowd = (radius) => radius < 4;

/** @param {Scene} scene */
export function drawMarkers(scene) {
  const radius = markerRadius(scene.rows.length);
  for (const group of alike(scene)) {
    const rows = group.rows.filter((row) => !hasGhosts(scene.fleet, row));
    scene.ctx.globalAlpha = 1;
    strokeHeadings(scene, group, rows, radius);
    paintMarkers(scene, group, rows, radius);
  }
  scene.ctx.globalAlpha = 1;
}

/** Draw tags of other floors as faint rings. @param {Scene} scene @param {Int32Array} rows */
export function drawElsewhere({ ctx, view, palette, fleet }, rows) {
  const radius = markerRadius(rows.length);
  ctx.beginPath();
  for (const row of rows) {
    if (!fleet.hasPose(row) || fleet.isTurned(row)) continue;
    const [x, y] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
    ctx.moveTo(x + radius, y);
    ctx.arc(x, y, radius, 0, 2 * Math.PI);
  }
  ctx.globalAlpha = ELSEWHERE_ALPHA;
  ctx.strokeStyle = palette["ink-3"];
  ctx.lineWidth = 1.5;
  ctx.stroke();
  ctx.globalAlpha = 1;
}

/** Return whether the tag is drawn as its hypotheses instead of one dot. Without north these are no places of the map. @param {import("../data/fleet.js").Fleet} fleet
 * @param {number} row */
export const hasGhosts = (fleet, row) => fleet.state[row] === AMBIGUOUS && !fleet.isTurned(row) && !!fleet.value.hypotheses[row]?.length;

/** @param {Scene} scene @param {{state: number, stale: number}} group @param {number[]} rows @param {number} radius */
function paintMarkers({ ctx, view, palette, fleet }, group, rows, radius) {
  const colour = palette.state[group.state];
  const filled = isFilled(group.state, group.stale);
  const rim = isCrowd(radius) ? CROWD_RIM_PX : RIM_PX;
  const traced = filled ? radius + (rim - CROWD_RIM_PX) / 2 : radius; // half of the rim lies inside
  ctx.beginPath();
  for (const row of rows) {
    traceMarker(ctx, group.state, view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row]), traced);
  }
  if (!filled) {
    ctx.fillStyle = palette.map;
    if (STATES[group.state].shape !== "cross") ctx.fill();
    return haloStroke(ctx, palette, colour, 2, dashOf(group.state), FADE[group.stale]);
  }
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.strokeStyle = palette.map;
  ctx.lineWidth = rim;
  return ctx.stroke();
}

/** @param {Scene} scene @param {{state: number, stale: number}} group @param {number[]} rows @param {number} radius */
function strokeHeadings({ ctx, view, palette, fleet }, { state, stale }, rows, radius) {
  if (!STATES[state].placed) return;
  ctx.beginPath();
  for (const row of rows) {
    const heading = fleet.number.heading_rad[row];
    if (Number.isNaN(heading)) continue;
    traceTick(ctx, view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row]), heading, radius);
  }
  ctx.lineCap = "round";
  if (isCrowd(radius)) {
    [ctx.strokeStyle, ctx.lineWidth, ctx.globalAlpha] = [palette.state[state], 1.5, FADE[stale]];
    ctx.stroke();
  } else haloStroke(ctx, palette, palette.state[state], radius > 4 ? 2.5 : 1.5, [], FADE[stale]);
  ctx.lineCap = "butt";
  ctx.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number} heading
 * @param {number} radius */
export function traceTick(ctx, x, y, heading, radius) {
  const [cos, sin] = [Math.cos(heading), -Math.sin(heading)];
  const length = radius + (radius * TICK_PX) / 5.5;
  ctx.moveTo(x + radius * cos, y + radius * sin);
  ctx.lineTo(x + length * cos, y + length * sin);
}

/** Draw names beside the dots where they cover neither dots nor each other; the selected and the hovered tag always
 * get one. Return the boxes of the names. @param {Scene} scene @returns {number[][]} left, top, right, bottom */
export function drawLabels(scene) {
  const { ctx, palette } = scene;
  const first = [scene.selected, scene.hovered].filter((row) => row >= 0);
  const rest = scene.rows.length <= LABELS_UP_TO ? [...scene.rows].filter((row) => !first.includes(row)) : [];
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  /** @type {number[][]} */
  const taken = scene.rows.length <= LABELS_UP_TO ? [...scene.rows].map((row) => dotBox(scene, row)) : [];
  const dots = taken.length;
  for (const row of new Set([...first, ...rest])) {
    const important = first.includes(row);
    ctx.font = `${important ? 600 : 400} 12px ${palette.font}`;
    drawLabel(scene, row, important, taken);
  }
  return taken.slice(dots);
}

/** Return the box that a dot covers. @param {Scene} scene @param {number} row */
function dotBox({ view, fleet }, row) {
  const [x, y] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
  return [x - 7, y - 4, x + 7, y + 4];
}

/** @param {Scene} scene @param {number} row @param {boolean} important @param {number[][]} taken */
function drawLabel({ ctx, view, palette, fleet, now_ms }, row, important, taken) {
  const [x, y] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
  if (Number.isNaN(x + y)) return;
  const free = freeBox(view);
  const widthOf = (/** @type {string} */ text) => ctx.measureText(text).width;
  const { name, note } = labelOf(fleet, row, now_ms);
  const text = shortened(name, free[2] - free[0] - widthOf(note), widthOf) + note;
  const width = widthOf(text);
  const places = [[x + 13, y - 12], [x + 13, y + 13], [x - 13 - width, y - 12], [x - 13 - width, y + 13]];
  const boxes = places.map(([left, middle]) => [left, middle - 8, left + width, middle + 8]);
  const box = boxes.find((one) => inside(one, free) && !taken.some((other) => overlap(one, other)))
    ?? (important && inside([x, y, x, y], [0, 0, view.width, view.height]) ? movedInto(boxes[0], free) : null);
  if (!box) return;
  taken.push(box);
  haloText(ctx, palette, text, box[0], box[1] + 8, important ? palette.ink : palette["ink-2"]);
}

/** Return the name, and a note about the age or the ambiguity of the pose. @param {import("../data/fleet.js").Fleet} fleet
 * @param {number} row @param {number} now_ms @returns {{name: string, note: string}} */
function labelOf(fleet, row, now_ms) {
  const name = fleet.labels[row];
  if (fleet.staleness(row, now_ms)) return { name, note: ` · ${ago(fleet.age(row, now_ms))}` };
  return { name, note: fleet.state[row] === AMBIGUOUS ? " ?" : "" };
}

/** Return the part of the map that neither the buttons nor the scale bar cover. @param {import("./view.js").View} view */
const freeBox = ({ width, height, covered }) => [4, 4, width - covered - 4, height - SCALE_BAR_PX];

/** @param {number[]} box @param {number[]} free */
const inside = (box, free) => box[0] >= free[0] && box[1] >= free[1] && box[2] <= free[2] && box[3] <= free[3];

/** @param {number[]} box @param {number[]} free */
function movedInto(box, free) {
  const [width, height] = [box[2] - box[0], box[3] - box[1]];
  const left = Math.max(free[0], Math.min(box[0], free[2] - width));
  const top = Math.max(free[1], Math.min(box[1], free[3] - height));
  return [left, top, left + width, top + height];
}

/** @param {number[]} a @param {number[]} b left, top, right, bottom */
const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

/** Draw a ring in the colour that an operator has given to a tag. The dot keeps the colour of its state. @param {Scene} scene */
export function drawColours({ ctx, view, fleet, rows }) {
  ctx.lineWidth = 2.5;
  for (const row of rows) {
    if (!fleet.colours[row] || hasGhosts(fleet, row)) continue;
    ctx.beginPath();
    ctx.arc(view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row]), markerRadius(rows.length) + 3, 0, 2 * Math.PI);
    ctx.strokeStyle = fleet.colours[row];
    ctx.stroke();
  }
}

/** @param {Scene} scene */
export function drawSelection({ ctx, view, palette, fleet, selected, hovered, rows }) {
  const radius = markerRadius(rows.length);
  for (const [row, width] of [[hovered, 1.5], [selected, 2.5]]) {
    if (row < 0 || Number.isNaN(fleet.drawnX[row])) continue;
    ctx.beginPath();
    ctx.arc(view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row]), radius + 6, 0, 2 * Math.PI);
    haloStroke(ctx, palette, palette.accent, width);
  }
}
