/** Draw the uncertainty of poses (ellipses, hypotheses, range rings), and the trails. */

import { horizontal } from "./geometry.js";
import { percent } from "../data/format.js";
import { haloStroke, haloText, traceRing } from "./draw_site.js";
import { hasGhosts, markerRadius, traceTick } from "./draw_tags.js";
import { FADE, alike, heightOf } from "./scene.js";
import { AMBIGUOUS, STATES } from "../data/states.js";
import { TRAIL_S } from "../data/trails.js";

/** @typedef {import("./scene.js").Scene} Scene */

export const ELLIPSES_UP_TO = 1500;
const TRAILS_UP_TO = 300;
/** Above so many tags, the ellipses and trails of those that are not selected are thin and faint. */
const QUIET_ABOVE = 30;
const QUIET_ALPHA = 0.4;
const RINGS_UP_TO = 12;
const GHOSTS_UP_TO = 300;

/** @param {Scene} scene */
const isQuiet = (scene) => scene.rows.length > QUIET_ABOVE;

/** Draw the 95 % ellipses, filled only around a trusted pose. @param {Scene} scene */
export function drawEllipses(scene) {
  const { chosen } = scene;
  if (scene.rows.length > ELLIPSES_UP_TO) return;
  for (const { state, stale, rows } of alike(scene)) {
    if (!isQuiet(scene)) drawAlikeEllipses(scene, state, stale, rows, false);
    else drawAlikeEllipses(scene, state, stale, rows.filter((row) => !chosen.includes(row)), true);
  }
  if (!isQuiet(scene)) return;
  for (const row of chosen) {
    if (scene.rows.includes(row)) drawAlikeEllipses(scene, scene.fleet.state[row], scene.fleet.staleness(row, scene.now_ms), [row], false);
  }
}

/** @param {Scene} scene @param {number} state @param {0 | 1 | 2} stale @param {number[]} rows @param {boolean} quiet */
function drawAlikeEllipses(scene, state, stale, rows, quiet) {
  const { ctx, palette } = scene;
  ctx.beginPath();
  for (const row of rows) if (hasEllipse(scene.fleet, row, scene.selected)) traceRowEllipse(scene, row);
  const isTrusted = STATES[state].trusted && stale === 0;
  if (quiet) strokeQuietly(ctx, palette.state[state], isTrusted ? [] : [5, 4]);
  else paintEllipses(ctx, palette, palette.state[state], isTrusted, FADE[stale]);
}

/** @param {CanvasRenderingContext2D} ctx @param {string} colour @param {number[]} dash */
function strokeQuietly(ctx, colour, dash) {
  [ctx.globalAlpha, ctx.strokeStyle, ctx.lineWidth] = [QUIET_ALPHA, colour, 1];
  ctx.setLineDash(dash);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
}

/** Return whether a tag has an ellipse. One with an unknown position has it only while it is selected. @param {import("../data/fleet.js").Fleet} fleet
 * @param {number} row @param {number} selected */
export const hasEllipse = (fleet, row, selected) =>
  STATES[fleet.state[row]].placed || (row === selected && !hasGhosts(fleet, row) && !fleet.isTurned(row));

/** @param {CanvasRenderingContext2D} ctx @param {import("./palette.js").Palette} palette @param {string} colour @param {boolean} trusted
 * @param {number} alpha */
function paintEllipses(ctx, palette, colour, trusted, alpha) {
  ctx.fillStyle = colour;
  ctx.globalAlpha = 0.13 * alpha;
  if (trusted) ctx.fill();
  haloStroke(ctx, palette, colour, 1.25, trusted ? [] : [5, 4], alpha);
  ctx.globalAlpha = 1;
}

/** @param {Scene} scene @param {number} row */
function traceRowEllipse({ ctx, view, fleet }, row) {
  const { semi_major_m: major, semi_minor_m: minor, angle_rad: angle } = fleet.number;
  traceEllipse(ctx, view, fleet.drawnX[row], fleet.drawnY[row], major[row], minor[row], angle[row]);
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./view.js").View} view @param {number} x @param {number} y
 * @param {number} major @param {number} minor @param {number} angle */
function traceEllipse(ctx, view, x, y, major, minor, angle) {
  if (!(major > 0)) return;
  const [px, py, a, b] = [view.screenX(x), view.screenY(y), major * view.scale, minor * view.scale];
  ctx.moveTo(px + a * Math.cos(angle), py - a * Math.sin(angle));
  ctx.ellipse(px, py, a, b, -angle, 0, 2 * Math.PI);
}

/** Draw every hypothesis of the ambiguous tags, fainter the less likely it is. @param {Scene} scene
 * @param {(row: number) => boolean} wanted */
export function drawGhosts(scene, wanted) {
  const { fleet, ctx } = scene;
  let left = GHOSTS_UP_TO;
  for (let row = 0; row < fleet.size && left > 0; row++) {
    if (!hasGhosts(fleet, row) || !wanted(row)) continue;
    for (const ghost of fleet.value.hypotheses[row] ?? []) drawGhost(scene, row, ghost, left--);
  }
  ctx.globalAlpha = 1;
  ctx.setLineDash([]);
}

/** @param {Scene} scene @param {number} row @param {import("../data/fleet.js").Hypothesis} ghost @param {number} left */
function drawGhost({ ctx, view, palette, rows, selected }, row, ghost, left) {
  const [x, y] = [view.screenX(ghost.x), view.screenY(ghost.y)];
  const radius = markerRadius(rows.length);
  if (left <= 0 || x < -20 || x > view.width + 20 || y < -20 || y > view.height + 20) return;
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  traceTick(ctx, x, y, ghost.heading_rad, radius);
  const shape = row === selected ? ghost.ellipse_95 : null;
  if (shape) traceEllipse(ctx, view, ghost.x, ghost.y, shape.semi_major_m, shape.semi_minor_m, shape.angle_rad);
  haloStroke(ctx, palette, palette.state[AMBIGUOUS], 1.75, [3, 2.5], 0.35 + 0.65 * ghost.weight);
  if (row === selected) labelGhost(ctx, palette, percent(ghost.weight), x, y + 16);
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./palette.js").Palette} palette @param {string} text
 * @param {number} x @param {number} y */
function labelGhost(ctx, palette, text, x, y) {
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
  ctx.font = `11px ${palette.font}`;
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  haloText(ctx, palette, text, x, y, palette.state[AMBIGUOUS]);
}

/** Draw the ring on which a range puts a tag, for the selected tag and for tags with an unknown position.
 * @param {Scene} scene @param {(row: number) => boolean} wanted */
export function drawRangeRings(scene, wanted) {
  const { fleet } = scene;
  let left = RINGS_UP_TO;
  for (let row = 0; row < fleet.size && left > 0; row++) {
    if (STATES[fleet.state[row]].placed || row === scene.selected || !wanted(row)) continue;
    if (strokeRangeRing(scene, row, 0.45)) left--;
  }
  if (scene.selected >= 0) strokeRangeRing(scene, scene.selected, 0.9);
}

/** @param {Scene} scene @param {number} row @param {number} alpha */
function strokeRangeRing({ ctx, view, palette, fleet, roster, anchors, selected, now_ms }, row, alpha) {
  const anchor = anchors.find((other) => other.id === fleet.value.anchor[row]);
  const range = fleet.number.range_m[row];
  const stale = fleet.staleness(row, now_ms);
  if (!anchor || Number.isNaN(range) || (stale === 2 && row !== selected)) return false;
  const state = fleet.state[row];
  ctx.beginPath();
  traceRing(ctx, view, anchor.x, anchor.y, horizontal(range, anchor.z - heightOf(fleet, roster, row)));
  ctx.globalAlpha = alpha * FADE[stale];
  ctx.strokeStyle = palette.state[state];
  ctx.lineWidth = 1.25;
  ctx.setLineDash(STATES[state].trusted ? [1, 3] : [6, 5]);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
  return true;
}

/** @param {Scene} scene */
export function drawTrails(scene) {
  const rows = scene.rows.length <= TRAILS_UP_TO ? [...scene.rows] : [];
  const quiet = isQuiet(scene);
  for (const row of new Set([...rows, ...scene.chosen])) drawTrail(scene, row, quiet);
  scene.ctx.globalAlpha = 1;
  scene.ctx.setLineDash([]);
}

/** Draw a trail in pieces that fade with age, dashed where the pose was not trusted. @param {Scene} scene
 * @param {number} row @param {boolean} quiet whether those of tags that nobody chose are faint */
function drawTrail({ ctx, view, palette, fleet, trails, chosen, now_ms }, row, quiet) {
  const trail = trails.of(fleet.names[row]);
  if (!trail || trail.length < 2) return;
  const isChosen = chosen.includes(row);
  ctx.strokeStyle = palette.state[fleet.state[row]];
  ctx.lineWidth = isChosen ? 2.25 : quiet ? 1 : 1.5;
  ctx.lineJoin = "round";
  for (let from = 0; from < trail.length - 1; from += 15) {
    const to = Math.min(trail.length - 1, from + 15);
    const share = 1 - (now_ms - trail.time[trail.at(to)]) / (TRAIL_S * 1000);
    if (share <= 0) continue;
    ctx.globalAlpha = (isChosen ? 0.85 : quiet ? QUIET_ALPHA / 2 : 0.5) * share;
    ctx.setLineDash(trail.trusted[trail.at(to)] ? [] : [2, 4]);
    strokePiece(ctx, view, trail, from, to);
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./view.js").View} view
 * @param {NonNullable<ReturnType<import("../data/trails.js").Trails["of"]>>} trail @param {number} from @param {number} to */
function strokePiece(ctx, view, trail, from, to) {
  let down = false;
  ctx.beginPath();
  for (let i = from; i <= to; i++) {
    const at = trail.at(i);
    if (Number.isNaN(trail.x[at])) down = false;
    else if (down) ctx.lineTo(view.screenX(trail.x[at]), view.screenY(trail.y[at]));
    else ctx.moveTo(view.screenX(trail.x[at]), view.screenY(trail.y[at]));
    down = !Number.isNaN(trail.x[at]);
  }
  ctx.stroke();
}
