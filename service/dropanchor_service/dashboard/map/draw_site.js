/** Draw what does not move: grid, distance rings with labels, anchors, scale bar. */

import { distancesTo } from "./geometry.js";
import { distance } from "../data/format.js";
import { multiples, roundLength } from "./view.js";
import { t } from "../i18n/language.js";

/** @typedef {import("./view.js").View} View @typedef {import("./palette.js").Palette} Palette */
/** @typedef {{id: string, x: number, y: number, z: number}} Anchor */

const GRID_PX = 26;
const RING_PX = 88;
/** Height of the scale bar with its text, from the lower edge of the map. */
export const SCALE_BAR_PX = 40;
/** Half the width of the mark of an anchor. */
export const ANCHOR_PX = 12;

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette */
export function drawGrid(ctx, view, palette) {
  const step = roundLength(GRID_PX / view.scale);
  ctx.lineWidth = 1;
  traceGrid(ctx, view, step);
  ctx.strokeStyle = palette.grid;
  ctx.stroke();
  traceGrid(ctx, view, 5 * step);
  ctx.strokeStyle = palette["grid-strong"];
  ctx.stroke();
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {number} step */
function traceGrid(ctx, view, step) {
  const seen = view.bounds();
  ctx.beginPath();
  for (const x of multiples(seen.left, seen.right, step)) {
    const px = Math.round(view.screenX(x)) + 0.5;
    ctx.moveTo(px, 0);
    ctx.lineTo(px, view.height);
  }
  for (const y of multiples(seen.bottom, seen.top, step)) {
    const py = Math.round(view.screenY(y)) + 0.5;
    ctx.moveTo(0, py);
    ctx.lineTo(view.width, py);
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {Anchor} anchor */
export function drawRings(ctx, view, palette, anchor) {
  const step = roundLength(RING_PX / view.scale);
  const [near, far] = distancesTo(anchor.x, anchor.y, view.bounds());
  const radii = multiples(Math.max(step, near), far, step);
  ctx.beginPath();
  for (const radius of radii) traceRing(ctx, view, anchor.x, anchor.y, radius);
  ctx.strokeStyle = palette.ring;
  ctx.lineWidth = 1;
  ctx.stroke();
  for (const radius of radii) labelRing(ctx, view, palette, anchor, radius);
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {number} x @param {number} y @param {number} radius_m */
export function traceRing(ctx, view, x, y, radius_m) {
  const [px, py, r] = [view.screenX(x), view.screenY(y), radius_m * view.scale];
  ctx.moveTo(px + r, py);
  ctx.arc(px, py, r, 0, 2 * Math.PI);
}

/** Label a ring in the first direction in which the label is on the screen.
 * @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {Anchor} anchor
 * @param {number} radius */
function labelRing(ctx, view, palette, anchor, radius) {
  for (let turn = 1; turn < 16; turn += 2) {
    const px = view.screenX(anchor.x + radius * Math.cos((turn * Math.PI) / 8));
    const py = view.screenY(anchor.y + radius * Math.sin((turn * Math.PI) / 8));
    if (px < 30 || px > view.width - 60 || py < 16 || py > view.height - 40) continue;
    ctx.font = `11px ${palette.font}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    haloText(ctx, palette, distance(radius), px, py, palette["ink-3"]);
    return;
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {Palette} palette @param {string} text @param {number} x
 * @param {number} y @param {string} colour */
export function haloText(ctx, palette, text, x, y, colour) {
  ctx.lineWidth = 4;
  ctx.lineJoin = "round";
  ctx.strokeStyle = palette.map;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}

/** How far a line in the colour of the map reaches beyond what it makes visible on a plan, a photo or another mark. */
const HALO_PX = 1.5;

/** Stroke the path on a wider, solid and opaque line in the colour of the map. @param {CanvasRenderingContext2D} ctx
 * @param {Palette} palette @param {string} colour @param {number} width @param {number[]} [dash] @param {number} [alpha] */
export function haloStroke(ctx, palette, colour, width, dash = [], alpha = 1) {
  ctx.globalAlpha = 1;
  ctx.setLineDash([]);
  ctx.lineWidth = width + 2 * HALO_PX;
  ctx.strokeStyle = palette.map;
  ctx.stroke();
  ctx.globalAlpha = alpha;
  ctx.setLineDash(dash);
  ctx.lineWidth = width;
  ctx.strokeStyle = colour;
  ctx.stroke();
  ctx.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette @param {readonly Anchor[]} anchors */
export function drawAnchors(ctx, view, palette, anchors) {
  for (const anchor of anchors) {
    const [x, y] = [view.screenX(anchor.x), view.screenY(anchor.y)];
    ctx.beginPath();
    ctx.arc(x, y, 10, 0, 2 * Math.PI);
    ctx.fillStyle = palette.anchor;
    ctx.fill();
    ctx.lineWidth = 3;
    ctx.strokeStyle = palette.map;
    ctx.stroke();
    traceAnchorSign(ctx, x, y);
    const { text, top, font } = anchorLabel(palette, anchor);
    [ctx.font, ctx.textAlign, ctx.textBaseline] = [font, "center", "top"];
    haloText(ctx, palette, text, x, y + top, palette["ink-2"]);
  }
}

/** Return the name below the mark of an anchor, and where it stands. @param {Palette} palette @param {Anchor} anchor */
export const anchorLabel = (palette, { id }) => ({ text: t("map.anchor", { id }), top: 15, height: 12, font: `600 11px ${palette.font}` });

/** @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y */
function traceAnchorSign(ctx, x, y) {
  ctx.beginPath();
  ctx.arc(x, y - 4, 1.5, 0, 2 * Math.PI);
  ctx.moveTo(x, y - 2.5);
  ctx.lineTo(x, y + 5);
  ctx.moveTo(x - 2.5, y - 0.5);
  ctx.lineTo(x + 2.5, y - 0.5);
  ctx.moveTo(x + 4.5, y + 1);
  ctx.arc(x, y + 0.5, 4.5, 0.1, Math.PI - 0.1);
  ctx.lineWidth = 1.3;
  ctx.lineCap = "round";
  ctx.stroke();
  ctx.lineCap = "butt";
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Palette} palette */
export function drawScaleBar(ctx, view, palette) {
  const length = roundLength(64 / view.scale);
  const [x, y, width] = [16, view.height - 18, length * view.scale];
  ctx.beginPath();
  ctx.moveTo(x + 0.5, y - 5);
  ctx.lineTo(x + 0.5, y + 0.5);
  ctx.lineTo(x + width + 0.5, y + 0.5);
  ctx.lineTo(x + width + 0.5, y - 5);
  haloStroke(ctx, palette, palette["ink-2"], 1.5);
  ctx.font = `11px ${palette.font}`;
  ctx.textAlign = "center";
  ctx.textBaseline = "alphabetic";
  haloText(ctx, palette, distance(length), x + width / 2, y - 6, palette["ink-2"]);
}
