/** What the overview of the sites shows: which ones, in which order, and where on its map. */

/**
 * @typedef {object} Summary as in the contract
 * @property {string} site
 * @property {string} name
 * @property {{lat: number, lon: number} | null} georeference
 * @property {number} tags
 * @property {number} online
 * @property {Record<string, number>} states
 * @property {number} needs_care
 */

/** @typedef {{site: Summary, x: number, y: number}} Dot */

export const MAP = { width: 960, height: 360, margin: 48 };
const SMALLEST_DEGREES = 0.02; // a company in one town does not become a map of its roofs

/** @param {Summary} one */
export const nameOf = (one) => one.name || one.site;

/** Return the sites whose name or id holds the text: those that need care first, then by name.
 * @param {Summary[]} sites @param {string} text */
export function listed(sites, text) {
  const wanted = text.trim().toLocaleLowerCase();
  return sites
    .filter((one) => `${one.name} ${one.site}`.toLocaleLowerCase().includes(wanted))
    .sort((a, b) => b.needs_care - a.needs_care || nameOf(a).localeCompare(nameOf(b)));
}

/**
 * Return where the georeferenced sites lie on the map: east to the right, north up, and a degree as long in both
 * directions as it is in the middle of the map.
 * @param {Summary[]} sites @returns {Dot[]}
 */
export function dots(sites) {
  const placed = sites.flatMap((site) => (site.georeference ? [{ site, ...site.georeference }] : []));
  if (placed.length === 0) return [];
  const west = placed[0].lon;
  const lons = placed.map(({ lon }) => west + ((lon - west + 540) % 360) - 180); // the short way round the Earth
  const [lon, lonSpan] = middle(lons);
  const [lat, latSpan] = middle(placed.map((one) => one.lat));
  const shrunk = Math.max(Math.cos((lat * Math.PI) / 180), 0.01);
  const { width, height, margin } = MAP;
  const scale = Math.min((width - 2 * margin) / (lonSpan * shrunk), (height - 2 * margin) / latSpan);
  return placed.map((one, i) => ({
    site: one.site, x: width / 2 + (lons[i] - lon) * shrunk * scale, y: height / 2 - (one.lat - lat) * scale,
  }));
}

/** Return the middle of values and how far they reach. @param {number[]} values */
function middle(values) {
  const [least, most] = values.reduce(([low, high], one) => [Math.min(low, one), Math.max(high, one)], [Infinity, -Infinity]);
  return [(least + most) / 2, Math.max(most - least, SMALLEST_DEGREES)];
}
