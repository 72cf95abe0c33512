/** Draw the stored track of a tag over a longer time: dashed where it is doubtful, broken where nothing is known. */

import { DOUBTFUL, TRACKING } from "../data/packed_tracks.js";

/** @typedef {import("../data/tracks.js").Track} Track @typedef {import("./scene.js").Scene} Scene */

/** @param {Scene} scene @param {Track} track @param {string} [colour] of the tag; empty: none */
export function drawTrack({ ctx, view, palette }, track, colour = "") {
  ctx.strokeStyle = colour || palette.accent;
  ctx.lineWidth = 1.5;
  ctx.lineJoin = "round";
  ctx.globalAlpha = 0.55;
  for (const [known, dash] of /** @type {const} */ ([[TRACKING, []], [DOUBTFUL, [2, 4]]])) {
    ctx.setLineDash([...dash]);
    ctx.beginPath();
    for (let i = 1; i < track.time.length; i++) {
      if (track.since[i] !== known) continue;
      ctx.moveTo(view.screenX(track.x[i - 1]), view.screenY(track.y[i - 1]));
      ctx.lineTo(view.screenX(track.x[i]), view.screenY(track.y[i]));
    }
    ctx.stroke();
  }
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
}
