/** Draw zones: dashed while nobody is inside, grey while that is not known, such as in the past. */

import { haloStroke, haloText } from "../map/draw_site.js";
import { tagCount } from "../data/format.js";
import { t } from "../i18n/language.js";

/** @typedef {import("./zone_store.js").Zone} Zone @typedef {import("./zone_store.js").Shape} Shape */
/** @typedef {import("../map/view.js").View} View */

const FILL_ALPHA = 0.1;
const EMPTY_DASH = [7, 5];

/**
 * @param {import("../map/scene.js").Scene} scene @param {readonly Zone[]} zones
 * @param {ReadonlyMap<string, number>} inside tags by zone @param {string | null} selected id of a zone
 */
export function drawZones(scene, zones, inside, selected) {
  const { ctx } = scene;
  ctx.save();
  for (const zone of zones) {
    const isKnown = scene.fleet.current && !scene.fleet.past;
    drawShape(scene, zone.shape, {
      colour: isKnown ? zone.colour : scene.palette["ink-3"],
      dash: isKnown && inside.has(zone.id) ? [] : EMPTY_DASH,
      width: zone.id === selected ? 4 : 2,
    });
    labelZone(scene, zone, isKnown ? (inside.get(zone.id) ?? 0) : 0);
  }
  ctx.restore();
}

/** @param {import("../map/scene.js").Scene} scene @param {Shape} shape @param {{colour: string, dash: number[], width: number}} style */
export function drawShape({ ctx, view, palette }, shape, { colour, dash, width }) {
  ctx.beginPath();
  traceShape(ctx, view, shape);
  ctx.globalAlpha = FILL_ALPHA;
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.lineJoin = "round";
  haloStroke(ctx, palette, colour, width, dash);
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view @param {Shape} shape */
function traceShape(ctx, view, shape) {
  if (shape.type === "circle") {
    ctx.arc(view.screenX(shape.x), view.screenY(shape.y), shape.radius_m * view.scale, 0, 2 * Math.PI);
    return;
  }
  for (const [x, y] of shape.points) ctx.lineTo(view.screenX(x), view.screenY(y));
  ctx.closePath();
}

/** Return the point below which the name stands: the middle of the top edge. @param {Shape} shape @returns {[number, number]} */
export function labelPlace(shape) {
  if (shape.type === "circle") return [shape.x, shape.y + shape.radius_m];
  const xs = shape.points.map(([x]) => x);
  return [(Math.min(...xs) + Math.max(...xs)) / 2, Math.max(...shape.points.map(([, y]) => y))];
}

/** @param {import("../map/scene.js").Scene} scene @param {Zone} zone @param {number} tags inside */
function labelZone({ ctx, view, palette }, zone, tags) {
  const [x, y] = labelPlace(zone.shape);
  ctx.font = `600 12px ${palette.font}`;
  ctx.textAlign = "center";
  ctx.textBaseline = "bottom";
  const name = zone.name || zone.id;
  const text = tags > 0 ? t("zones.on_map", { zone: name, tags: tagCount(tags) }) : name;
  haloText(ctx, palette, text, view.screenX(x), view.screenY(y) - 5, palette["ink-2"]);
}
