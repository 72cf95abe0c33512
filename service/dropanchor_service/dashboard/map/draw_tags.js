/** Draw the dots and heading ticks of the tags. */

import { haloStroke } from "./draw_site.js";
import { FADE, alike } from "./scene.js";
import { dashOf, isFilled, traceMarker } from "./shapes.js";
import { AMBIGUOUS, STATES } from "../data/states.js";

/** @typedef {import("./scene.js").Scene} Scene */

const TICK_PX = 9;
const ELSEWHERE_ALPHA = 0.45;
const RIM_PX = 3;
/** Dots in a crowd are small: their halo is thin, and their headings have none. */
const CROWD_RIM_PX = 1.25;

/** More dots are smaller, and stamped. */
const PATHS_UP_TO = 200;

/** @param {number} count dots on the screen */
export const markerRadius = (count) => (count <= PATHS_UP_TO ? 5.5 : count <= 1500 ? 4 : 3);

/** @param {number} radius */
const isCrowd = (radius) => radius < 4;

/** @param {Scene} scene @param {import("./stamps.js").Stamps} stamps for many dots */
export function drawMarkers(scene, stamps) {
  const radius = markerRadius(scene.rows.length);
  for (const group of alike(scene)) {
    const rows = group.rows.filter((row) => !hasGhosts(scene.fleet, row));
    scene.ctx.globalAlpha = 1;
    if (scene.rows.length > PATHS_UP_TO) stamps.draw(scene, `${radius} ${group.state} ${group.stale}`, rows, (...place) => paintOne(scene, group, radius, ...place));
    else paintAlike(scene, group, rows, radius);
  }
  scene.ctx.globalAlpha = 1;
}

/** @param {Scene} scene @param {{state: number, stale: number}} group @param {number[]} rows @param {number} radius */
function paintAlike(scene, group, rows, radius) {
  strokeHeadings(scene, group, rows, radius);
  paintMarkers(scene, group, rows, radius);
}

/** Paint the dot of a stamp. @param {Scene} scene @param {{state: number, stale: number}} group @param {number} radius
 * @param {CanvasRenderingContext2D} ctx @param {number} heading_rad @param {number} centre_px */
function paintOne(scene, group, radius, ctx, heading_rad, centre_px) {
  const view = /** @type {any} */ ({ screenX: () => centre_px, screenY: () => centre_px });
  const fleet = /** @type {any} */ ({ drawnX: [0], drawnY: [0], number: { heading_rad: [heading_rad] } });
  paintAlike({ ...scene, ctx, view, fleet }, group, [0], radius);
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
export function drawSelection({ ctx, view, palette, fleet, chosen, colourOf, hovered, rows }) {
  const radius = markerRadius(rows.length);
  for (const [row, width] of [[hovered, 1.5], ...chosen.map((row) => [row, 2.5])]) {
    if (row < 0 || Number.isNaN(fleet.drawnX[row])) continue;
    ctx.beginPath();
    ctx.arc(view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row]), radius + 6, 0, 2 * Math.PI);
    haloStroke(ctx, palette, colourOf(row) || palette.accent, width);
  }
}
