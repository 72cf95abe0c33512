/** Draw rings around tags with alarms: two for an alarm, one broken for a warning. Shape says it, too, and not colour alone. */

import { haloStroke } from "../map/draw_site.js";

const RADIUS_PX = 12;
const APART_PX = 5;
const DASH = [5, 4];

/** @param {import("../map/scene.js").Scene} scene @param {ReadonlyMap<string, "warning" | "alarm">} tags @param {(row: number) => boolean} isShown */
export function drawAlarms({ ctx, view, fleet, palette }, tags, isShown) {
  for (const [tag, severity] of tags) {
    const row = fleet.row(tag);
    if (row < 0 || Number.isNaN(fleet.drawnX[row]) || !isShown(row)) continue;
    const [x, y] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
    for (const radius of severity === "alarm" ? [RADIUS_PX, RADIUS_PX + APART_PX] : [RADIUS_PX]) {
      ctx.beginPath();
      ctx.arc(x, y, radius, 0, 2 * Math.PI);
      haloStroke(ctx, palette, palette[severity], 2.5, severity === "alarm" ? [] : DASH);
    }
  }
}
