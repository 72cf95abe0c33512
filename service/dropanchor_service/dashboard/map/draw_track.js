/** Draw the stored track of a tag over a longer time: dashed where it is doubtful, faint dots where the line is only a sketch of it, broken where nothing is known. */

import { DOUBTFUL, TRACKING } from "../data/packed_tracks.js";
import { haloStroke } from "./draw_site.js";

/** A line is drawn as one where no stored pose is farther from it. */
const SKETCH_PX = 1;
const RING_PX = 7;

/** @typedef {Pick<import("../data/tracks.js").Track, "time" | "x" | "y" | "since" | "off_m">} Line @typedef {import("./scene.js").Scene} Scene */

/** @param {Scene} scene @param {Line} track @param {string} colour */
export function drawTrack({ ctx, view }, track, colour) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1.5;
  ctx.lineJoin = "round";
  ctx.globalAlpha = 0.55;
  const isSketch = (/** @type {number} */ i) => !(track.off_m[i] * view.scale <= SKETCH_PX);
  for (const [known, sketched, dash] of /** @type {const} */ ([[TRACKING, false, []], [DOUBTFUL, false, [2, 4]], [TRACKING, true, [1, 6]], [DOUBTFUL, true, [1, 6]]])) {
    ctx.setLineDash([...dash]);
    ctx.beginPath();
    for (let i = 1; i < track.time.length; i++) {
      if (track.since[i] !== known || isSketch(i) !== sketched) continue;
      ctx.moveTo(view.screenX(track.x[i - 1]), view.screenY(track.y[i - 1]));
      ctx.lineTo(view.screenX(track.x[i]), view.screenY(track.y[i]));
    }
    ctx.stroke();
  }
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
}

/** Draw where a tag would have been, with a ring at a time. @param {Scene} scene @param {Line} line @param {number} time_ms */
export function drawOther(scene, line, time_ms) {
  const { ctx, view, palette } = scene;
  drawTrack(scene, line, palette.warning);
  const at = line.time.findLastIndex((one) => one <= time_ms);
  if (at < 0 || Number.isNaN(line.x[at])) return;
  ctx.beginPath();
  ctx.arc(view.screenX(line.x[at]), view.screenY(line.y[at]), RING_PX, 0, 2 * Math.PI);
  haloStroke(ctx, palette, palette.warning, 3);
}
