/** The marker of each state as a path; the same shapes as the symbols in index.html. */

import { STATES } from "../data/states.js";

/** Add the outline of a state's marker to the path. @param {CanvasRenderingContext2D} ctx
 * @param {number} state @param {number} x @param {number} y @param {number} r radius, pixels */
export function traceMarker(ctx, state, x, y, r) {
  switch (STATES[state].shape) {
    case "diamond":
      return tracePolygon(ctx, [x, y - 1.25 * r, x + 1.25 * r, y, x, y + 1.25 * r, x - 1.25 * r, y]);
    case "triangle":
      return tracePolygon(ctx, [x, y - 1.3 * r, x + 1.2 * r, y + r, x - 1.2 * r, y + r]);
    case "square":
      return tracePolygon(ctx, [x - r, y - r, x + r, y - r, x + r, y + r, x - r, y + r]);
    case "cross":
      ctx.moveTo(x - r, y - r);
      ctx.lineTo(x + r, y + r);
      ctx.moveTo(x + r, y - r);
      ctx.lineTo(x - r, y + r);
      return undefined;
    default:
      ctx.moveTo(x + r, y);
      return ctx.arc(x, y, r, 0, 2 * Math.PI);
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {number[]} corners x, y, x, y, … */
function tracePolygon(ctx, corners) {
  ctx.moveTo(corners[0], corners[1]);
  for (let i = 2; i < corners.length; i += 2) ctx.lineTo(corners[i], corners[i + 1]);
  ctx.closePath();
}

/** Return the dash pattern of a state's marker. @param {number} state @returns {number[]} */
export function dashOf(state) {
  const shape = STATES[state].shape;
  return shape === "ring" ? [3, 2.5] : shape === "dotted" ? [1, 2.5] : [];
}

/** Return whether the marker is filled: only that of a fresh and trusted pose is. @param {number} state @param {number} stale */
export const isFilled = (state, stale) => STATES[state].trusted && stale === 0;
