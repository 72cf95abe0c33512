/** Draw the two halves of an ellipse that mostly shows that north is not known: how far the whole track may be turned about the
 * anchor, as an arc, and what is left of the ellipse without it. */

import { haloStroke } from "./draw_site.js";

/** @typedef {import("./scene.js").Scene} Scene @typedef {import("../data/evidence.js").Explanation} Explanation */

/** Standard deviations that hold 95 %, along a line and in the plane. */
const [ALONG_A_LINE, IN_THE_PLANE] = [1.96, 2.448];
const CAP = 0.03; // rad, of the strokes at the ends of the arc, on either side

/** @param {Scene} scene @param {Explanation | null} explanation */
export function drawTurn(scene, explanation) {
  const { ctx, view, palette, fleet, anchors, selected } = scene;
  const pose = explanation?.pose;
  const anchor = anchors.find(({ id }) => id === pose?.anchor);
  if (selected < 0 || !anchor || explanation?.uncertainty?.largest !== "north" || !pose.covariance) return;
  const [dx, dy] = [fleet.drawnX[selected] - anchor.x, fleet.drawnY[selected] - anchor.y];
  const radius = Math.hypot(dx, dy);
  const half = Math.min((ALONG_A_LINE * pose.sigma_parts.north_m) / radius, Math.PI);
  const bearing = Math.atan2(dy, dx);
  const colour = palette.state[fleet.state[selected]];
  ctx.beginPath();
  traceArc(ctx, view, anchor, radius, bearing - half, bearing + half);
  haloStroke(ctx, palette, colour, 1.75);
  const shape = withoutTurn(pose.covariance, pose.sigma_parts.north_m, bearing);
  ctx.beginPath();
  const scale = IN_THE_PLANE * view.scale;
  ctx.ellipse(view.screenX(fleet.drawnX[selected]), view.screenY(fleet.drawnY[selected]), scale * shape.major, scale * shape.minor, -shape.angle, 0, 2 * Math.PI);
  haloStroke(ctx, palette, colour, 1.5);
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./view.js").View} view @param {{x: number, y: number}} middle
 * @param {number} radius @param {number} from @param {number} to rad, counter-clockwise from east */
function traceArc(ctx, view, middle, radius, from, to) {
  const [x, y, r] = [view.screenX(middle.x), view.screenY(middle.y), radius * view.scale];
  for (const end of [from, to]) {
    ctx.moveTo(x + r * (1 - CAP) * Math.cos(end), y - r * (1 - CAP) * Math.sin(end));
    ctx.lineTo(x + r * (1 + CAP) * Math.cos(end), y - r * (1 + CAP) * Math.sin(end));
  }
  ctx.moveTo(x + r * Math.cos(from), y - r * Math.sin(from));
  ctx.arc(x, y, r, -from, -to, true);
}

/** Return the semi-axes, in standard deviations, and the direction of an ellipse without the part that lies across a bearing.
 * @param {number[][]} covariance of (x, y, …) @param {number} across its standard deviation, m @param {number} bearing rad */
export function withoutTurn(covariance, across, bearing) {
  const [tx, ty] = [-Math.sin(bearing), Math.cos(bearing)];
  const xx = covariance[0][0] - across ** 2 * tx * tx;
  const xy = covariance[0][1] - across ** 2 * tx * ty;
  const yy = covariance[1][1] - across ** 2 * ty * ty;
  const [mean, spread] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  const root = (/** @type {number} */ variance) => Math.sqrt(Math.max(variance, 0));
  return { major: root(mean + spread), minor: root(mean - spread), angle: Math.atan2(2 * xy, xx - yy) / 2 };
}
