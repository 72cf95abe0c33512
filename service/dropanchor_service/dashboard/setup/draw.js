/** Draw what is being set up: the anchor that is edited, and the start of a tag. */

import { haloStroke } from "../map/draw_site.js";

const ARROW_PX = 44;

/** @param {CanvasRenderingContext2D} ctx @param {import("../map/view.js").View} view @param {import("../map/palette.js").Palette} palette
 * @param {import("../map/draw_site.js").Anchor} anchor @param {import("../map/draw_site.js").Anchor | null} origin where it stands until it is moved */
export function drawEditedAnchor(ctx, view, palette, anchor, origin) {
  if (origin) {
    ctx.beginPath();
    ctx.arc(view.screenX(origin.x), view.screenY(origin.y), 5, 0, 2 * Math.PI);
    ctx.moveTo(view.screenX(origin.x), view.screenY(origin.y));
    ctx.lineTo(view.screenX(anchor.x), view.screenY(anchor.y));
    haloStroke(ctx, palette, palette.accent, 1.5, [4, 4]);
  }
  ctx.beginPath();
  ctx.arc(view.screenX(anchor.x), view.screenY(anchor.y), 15, 0, 2 * Math.PI);
  ctx.lineWidth = 2.5;
  ctx.strokeStyle = palette.accent;
  ctx.stroke();
}

/** @param {CanvasRenderingContext2D} ctx @param {import("../map/view.js").View} view @param {import("../map/palette.js").Palette} palette
 * @param {import("./start.js").Start} start */
export function drawStart(ctx, view, palette, { x, y, heading_rad }) {
  ctx.save();
  ctx.translate(view.screenX(x), view.screenY(y));
  ctx.strokeStyle = ctx.fillStyle = palette.accent;
  ctx.lineWidth = 2.5;
  ctx.beginPath();
  ctx.arc(0, 0, 8, 0, 2 * Math.PI);
  ctx.stroke();
  if (heading_rad !== null) {
    ctx.rotate(-heading_rad);
    ctx.beginPath();
    ctx.moveTo(8, 0);
    ctx.lineTo(ARROW_PX, 0);
    ctx.stroke();
    ctx.beginPath();
    ctx.moveTo(ARROW_PX + 8, 0);
    ctx.lineTo(ARROW_PX - 4, -7);
    ctx.lineTo(ARROW_PX - 4, 7);
    ctx.fill();
  }
  ctx.restore();
}
