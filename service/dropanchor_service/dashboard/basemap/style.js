/** The plain look of vector tiles: which features are drawn, and how. It knows the layers of Protomaps, OpenMapTiles and
 * Shortbread; of other layers it draws thin lines. */

import { LINE, POLYGON } from "./vector_tile.js";

/**
 * @typedef {object} Style
 * @property {"base-green" | "base-water" | "base-building" | "base-road" | "base-line"} colour of the style sheet
 * @property {number} [width_m] of a line on the ground; without it, the feature is filled
 * @property {number} [least_px] width of a line on the screen, at least
 */

/** In the order of drawing. @type {Record<string, Style>} */
export const STYLES = {
  green: { colour: "base-green" },
  water: { colour: "base-water" },
  stream: { colour: "base-water", width_m: 3, least_px: 1 },
  paved: { colour: "base-road" },
  building: { colour: "base-building" },
  path: { colour: "base-road", width_m: 2, least_px: 0.75 },
  minor: { colour: "base-road", width_m: 6, least_px: 1.25 },
  major: { colour: "base-road", width_m: 10, least_px: 2.5 },
  rail: { colour: "base-line", width_m: 1.5, least_px: 1 },
  other: { colour: "base-line", width_m: 0, least_px: 1 },
};

const WATER = /^(water|ocean|waterway|water_polygons|water_lines|physical_line)$/;
const GROUND = /^(land|landcover|landuse|natural|park|sites)$/;
const BUILDINGS = /^buildings?$/;
const ROADS = /^(roads?|streets?|street_polygons|transportation|transit)$/;
const NOT_DRAWN = /^(earth|aerialways|aerodrome|boundar(y|ies)|ferries|housenumber|places?|pois?)$|label|_name/;

const GREEN = /park|forest|wood|grass|meadow|scrub|garden|farm|orchard|vineyard|cemetery|grave|pitch|golf|recreation|village_green|wetland|nature|heath|allotments/;
const NOT_GREEN = /parking|car_park/;
const MAJOR = /^(highway|major_road|motorway|trunk|primary|secondary)/;
const PATH = /path|foot|pedestrian|steps|track|cycle|bridleway/;
const RAIL = /rail|tram|subway|transit|monorail|funicular/;
const NO_ROAD = /ferry|aerialway|cable|pier/;

/** Return the name of the style of a feature; null: it is not drawn. @param {string} layer @param {string} kind @param {number} type */
export function styleOf(layer, kind, type) {
  if (type !== LINE && type !== POLYGON) return null;
  const isArea = type === POLYGON;
  if (WATER.test(layer)) return isArea ? "water" : "stream";
  if (GROUND.test(layer)) return isArea && isGreen(layer, kind) ? "green" : null;
  if (BUILDINGS.test(layer)) return isArea ? "building" : null;
  if (ROADS.test(layer)) return isArea ? "paved" : roadStyle(kind);
  return NOT_DRAWN.test(layer) ? null : "other";
}

/** @param {string} layer @param {string} kind */
const isGreen = (layer, kind) => layer === "park" || (GREEN.test(kind) && !NOT_GREEN.test(kind));

/** @param {string} kind */
function roadStyle(kind) {
  if (NO_ROAD.test(kind)) return null;
  if (RAIL.test(kind)) return "rail";
  if (PATH.test(kind)) return "path";
  return MAJOR.test(kind) ? "major" : "minor";
}

/** Return the width of a line in pixels. @param {Style} style @param {number} scale pixels per metre */
export const widthOf = ({ width_m = 0, least_px = 0 }, scale) => Math.max(least_px, width_m * scale);
