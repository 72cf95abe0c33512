/** Draw the names of the tags. */

import { ago } from "../data/format.js";
import { shortened } from "../data/names.js";
import { AMBIGUOUS, STATES } from "../data/states.js";
import { ANCHOR_PX, SCALE_BAR_PX, anchorLabel, haloText } from "./draw_site.js";
import { LabelPlaces } from "./label_places.js";

/** @typedef {import("./scene.js").Scene} Scene @typedef {import("./label_places.js").Wanted} Wanted */

const LABELS_UP_TO = 400;
const DOT_PX = 7;
const MOST_WIDTHS = 2000;

export class Labels {
  #places = new LabelPlaces();
  #widths = new Widths();

  /** Draw names where they have room; the selected and the hovered tags always get one. Return the boxes of the names.
   * @param {Scene} scene @param {number[][]} hints boxes of buttons @returns {number[][]} left, top, right, bottom */
  draw(scene, hints) {
    const { ctx, fleet, palette } = scene;
    const rows = scene.rows.length <= LABELS_UP_TO ? scene.rows : [];
    /** @type {Map<string, {text: string, must: boolean}>} */
    const texts = new Map();
    /** @type {Wanted[]} */
    const wanted = [];
    for (const row of new Set([...scene.chosen, scene.hovered, ...rows])) {
      const one = this.#wanted(scene, row);
      if (one) wanted.push(one);
      if (one) texts.set(one.key, one);
    }
    const boxes = this.#places.arrange(wanted, [...hints, ...obstaclesOf(scene, [...rows])], freeBox(scene.view));
    [ctx.textAlign, ctx.textBaseline] = ["left", "middle"];
    for (const [key, box] of boxes) {
      const { text, must } = /** @type {{text: string, must: boolean}} */ (texts.get(key));
      ctx.font = fontOf(palette, must);
      haloText(ctx, palette, text, box[0], (box[1] + box[3]) / 2, must ? palette.ink : palette["ink-2"]);
    }
    return [...boxes.values()];
  }

  /** Return what is to stand beside a dot; null for no dot, and for one out of sight. @param {Scene} scene @param {number} row */
  #wanted({ ctx, view, palette, fleet, chosen, hovered, now_ms }, row) {
    if (row < 0) return null;
    const [x, y] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
    if (!(x >= 0 && x <= view.width && y >= 0 && y <= view.height)) return null;
    const must = chosen.includes(row) || row === hovered;
    const widthOf = (/** @type {string} */ text) => this.#widths.of(ctx, fontOf(palette, must), text);
    const { name, note } = labelOf(fleet, row, now_ms);
    const free = freeBox(view);
    const text = shortened(name, free[2] - free[0] - widthOf(note), widthOf) + note;
    return { key: fleet.names[row], x, y, width: widthOf(text), must, trusted: STATES[fleet.state[row]].trusted, text };
  }
}

/** Widths of texts, remembered, because measuring takes longer than placing. */
class Widths {
  /** @type {Map<string, number>} */
  #known = new Map();

  /** @param {CanvasRenderingContext2D} ctx @param {string} font @param {string} text */
  of(ctx, font, text) {
    const key = `${font}/${text}`;
    const known = this.#known.get(key);
    if (known !== undefined) return known;
    if (this.#known.size >= MOST_WIDTHS) this.#known.clear();
    ctx.font = font;
    const { width } = ctx.measureText(text);
    this.#known.set(key, width);
    return width;
  }
}

/** @param {import("./palette.js").Palette} palette @param {boolean} must */
const fontOf = (palette, must) => `${must ? 600 : 400} 12px ${palette.font}`;

/** Return the boxes of dots, anchors and the names of anchors. @param {Scene} scene @param {number[]} rows */
function obstaclesOf({ ctx, view, palette, fleet, anchors }, rows) {
  const dots = rows.map((row) => boxAround(view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row]), DOT_PX, DOT_PX));
  const signs = anchors.flatMap((anchor) => {
    const [x, y] = [view.screenX(anchor.x), view.screenY(anchor.y)];
    const { text, top, height, font } = anchorLabel(palette, anchor);
    ctx.font = font;
    return [boxAround(x, y, ANCHOR_PX, ANCHOR_PX), boxAround(x, y + top + height / 2, ctx.measureText(text).width / 2, height / 2)];
  });
  return [...dots, ...signs];
}

/** @param {number} x @param {number} y @param {number} across @param {number} down */
const boxAround = (x, y, across, down) => [x - across, y - down, x + across, y + down];

/** Return the name, and a note about the age or the ambiguity of the pose. @param {import("../data/fleet.js").Fleet} fleet
 * @param {number} row @param {number} now_ms @returns {{name: string, note: string}} */
function labelOf(fleet, row, now_ms) {
  const name = fleet.labels[row];
  if (fleet.staleness(row, now_ms)) return { name, note: ` · ${ago(fleet.age(row, now_ms))}` };
  return { name, note: fleet.state[row] === AMBIGUOUS ? " ?" : "" };
}

/** Return the part of the map that neither the buttons nor the scale bar cover. @param {import("./view.js").View} view */
const freeBox = ({ width, height, covered }) => [4, 4, width - covered - 4, height - SCALE_BAR_PX];
