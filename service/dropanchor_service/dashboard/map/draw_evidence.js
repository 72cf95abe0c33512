/** Draw the evidence for the selected tag: its last range to each anchor, and the uncertainty of its heading. */

import { headingSigma, recentRanges } from "../data/evidence.js";
import { horizontal } from "./geometry.js";
import { length } from "../data/format.js";
import { haloText, traceRing } from "./draw_site.js";
import { hasGhosts } from "./draw_tags.js";
import { heightOf } from "./scene.js";

/** @typedef {import("./scene.js").Scene} Scene @typedef {import("../data/evidence.js").Explanation} Explanation */

const WEDGE_PX = 62;
/** Standard deviations to either side that hold 95 %, like the ellipse. */
const OF_95_PERCENT = 1.96;
const WIDEST = Math.PI / 2; // a heading that is less certain has no direction

/** @param {Scene} scene @param {Explanation | null} explanation */
export function drawEvidence(scene, explanation) {
  if (scene.selected < 0 || explanation === null) return;
  for (const [id, range] of recentRanges(explanation)) drawRecentRange(scene, id, range);
  drawWedge(scene, OF_95_PERCENT * headingSigma(explanation));
  scene.ctx.globalAlpha = 1;
}

/** Label the ring of an anchor, and draw it unless it is the newest one, which is drawn from the stream with the tags.
 * @param {Scene} scene @param {string} id @param {number} range */
function drawRecentRange({ ctx, view, palette, fleet, roster, anchors, selected }, id, range) {
  const anchor = anchors.find((other) => other.id === id);
  if (!anchor) return;
  const radius = horizontal(range, anchor.z - heightOf(fleet, roster, selected));
  const colour = palette.state[fleet.state[selected]];
  if (id !== fleet.value.anchor[selected]) {
    ctx.beginPath();
    traceRing(ctx, view, anchor.x, anchor.y, radius);
    ctx.globalAlpha = 0.6;
    ctx.strokeStyle = colour;
    ctx.lineWidth = 1.25;
    ctx.setLineDash([1, 3]);
    ctx.stroke();
    ctx.setLineDash([]);
  }
  ctx.globalAlpha = 1;
  ctx.font = `11px ${palette.font}`;
  ctx.textAlign = "center";
  ctx.textBaseline = "bottom";
  haloText(ctx, palette, length(range), view.screenX(anchor.x), view.screenY(anchor.y + radius) - 3, colour);
}

/** Draw a wedge that holds the heading with 95 %. @param {Scene} scene @param {number} half of its angle, rad */
function drawWedge({ ctx, view, palette, fleet, selected }, half) {
  const heading = fleet.number.heading_rad[selected];
  if (!(half < WIDEST) || Number.isNaN(heading) || hasGhosts(fleet, selected) || fleet.isTurned(selected)) return;
  const [x, y] = [view.screenX(fleet.drawnX[selected]), view.screenY(fleet.drawnY[selected])];
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.arc(x, y, WEDGE_PX, -heading - half, -heading + half);
  ctx.closePath();
  ctx.fillStyle = ctx.strokeStyle = palette.state[fleet.state[selected]];
  ctx.globalAlpha = 0.22;
  ctx.fill();
  ctx.globalAlpha = 0.7;
  ctx.lineWidth = 1;
  ctx.stroke();
}
