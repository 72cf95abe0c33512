/** What *Fit* brings into view. */

import { ELLIPSES_UP_TO, hasEllipse } from "./draw_doubt.js";
import { hasGhosts } from "./draw_tags.js";
import { reachOf } from "./geometry.js";

/** Yield the positions of anchors and tags, of all hypotheses of ambiguous tags, and corners around the ellipses.
 * @param {readonly import("./draw_site.js").Anchor[]} anchors @param {import("../data/fleet.js").Fleet} fleet
 * @param {import("../page/choice.js").Choice} choice @returns {Generator<[number, number]>} */
export function* placesToFit(anchors, fleet, choice) {
  const selected = fleet.row(choice.selected);
  for (const anchor of anchors) yield [anchor.x, anchor.y];
  for (let row = 0; row < fleet.size; row++) {
    if (!choice.shows(fleet, row)) continue;
    if (hasGhosts(fleet, row)) for (const ghost of fleet.value.hypotheses[row] ?? []) yield [ghost.x, ghost.y];
    else yield fleet.spot(row);
    if (fleet.size <= ELLIPSES_UP_TO && hasEllipse(fleet, row, selected)) yield* cornersOf(fleet, row);
  }
}

/** @param {import("../data/fleet.js").Fleet} fleet @param {number} row @returns {[number, number][]} */
function cornersOf(fleet, row) {
  const { semi_major_m: major, semi_minor_m: minor, angle_rad: angle } = fleet.number;
  const [x, y] = fleet.spot(row);
  const [right, up] = reachOf(major[row], minor[row], angle[row]);
  return [[x - right, y - up], [x + right, y + up]];
}
