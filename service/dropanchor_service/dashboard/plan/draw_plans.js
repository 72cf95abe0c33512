/** Draw plans on the ground of the map, and the points by which one is aligned. */

import { haloText } from "../map/draw_site.js";
import { cornersOf, isPlaced, siteOf } from "./transform.js";

/** @typedef {import("./plan_store.js").Plan} Plan */
/** @typedef {import("../map/view.js").View} View @typedef {import("../map/palette.js").Palette} Palette */

const CROSS_PX = 7;

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Plan} plan @param {HTMLCanvasElement[]} levels of its image */
export function drawPlan(ctx, view, { image, placement, opacity }, levels) {
  const scale = placement.m_per_px * view.scale;
  const wanted = scale * image.width_px * devicePixelRatio;
  const level = levels.findLast(({ width }) => width >= wanted) ?? levels[0];
  if (!level || opacity === 0) return;
  ctx.save();
  ctx.globalAlpha = opacity;
  ctx.translate(view.screenX(placement.x), view.screenY(placement.y));
  ctx.rotate(-placement.rotation_rad);
  ctx.scale(scale, scale);
  ctx.drawImage(level, -image.width_px / 2, -image.height_px / 2, image.width_px, image.height_px);
  ctx.restore();
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {import("./plan_editor.js").Draft} draft */
export function drawEditedPlan(ctx, view, palette, { image, placement, points }) {
  ctx.save();
  ctx.strokeStyle = palette.accent;
  ctx.lineWidth = 2;
  ctx.beginPath();
  for (const [x, y] of cornersOf(placement, image)) ctx.lineTo(view.screenX(x), view.screenY(y));
  ctx.closePath();
  ctx.stroke();
  points.forEach((point, i) => drawPoint(ctx, view, palette, siteOf(placement, image, point), point, i + 1));
  ctx.restore();
}

/** Draw a cross where the plan shows a point, a ring where the point is, and a line between them.
 * @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {[number, number]} shown
 * @param {import("./transform.js").Point} point @param {number} number */
function drawPoint(ctx, view, palette, shown, point, number) {
  const [px, py] = [view.screenX(shown[0]), view.screenY(shown[1])];
  ctx.strokeStyle = palette.accent;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(px - CROSS_PX, py);
  ctx.lineTo(px + CROSS_PX, py);
  ctx.moveTo(px, py - CROSS_PX);
  ctx.lineTo(px, py + CROSS_PX);
  if (isPlaced(point)) {
    const [x, y] = [view.screenX(point.x), view.screenY(point.y)];
    ctx.moveTo(px, py);
    ctx.lineTo(x, y);
    ctx.moveTo(x + CROSS_PX, y);
    ctx.arc(x, y, CROSS_PX, 0, 2 * Math.PI);
  }
  ctx.stroke();
  ctx.font = `600 12px ${palette.font}`;
  ctx.textAlign = "left";
  ctx.textBaseline = "bottom";
  haloText(ctx, palette, String(number), px + CROSS_PX + 2, py - 2, palette.accent);
}
