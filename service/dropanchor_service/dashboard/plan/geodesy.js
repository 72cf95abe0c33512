/** Latitude and longitude (WGS 84) of points on the ground, as a position in the site frame. */

/** @typedef {{lat: number, lon: number, rotation_rad: number}} Georeference of the origin of the site frame */

const SEMI_MAJOR_M = 6378137;
const ECCENTRICITY_SQUARED = 0.0066943799901413165;
const RAD = Math.PI / 180;
/** Each leaves less than a hundredth of the error: the Earth is not quite a sphere. */
const REFINEMENTS = 6;

/** Return the latitude and the longitude in a text such as "52.5163, 13.3777"; null: it holds no such pair. @param {string} text */
export function latLonIn(text) {
  const found = /^\s*(-?\d+(?:\.\d+)?)\s*°?\s*[,;\s]\s*(-?\d+(?:\.\d+)?)\s*°?\s*$/.exec(text);
  const [lat, lon] = found ? [Number(found[1]), Number(found[2])] : [NaN, NaN];
  return Math.abs(lat) <= 90 && Math.abs(lon) <= 180 ? { lat, lon } : null;
}

/** Return x and y in m. @param {Georeference} origin @param {{lat: number, lon: number}} point @returns {[number, number]} */
export function siteOfLatLon(origin, point) {
  const [from, to] = [geocentric(origin), geocentric(point)];
  const [dx, dy, dz] = to.map((value, i) => value - from[i]);
  const [sinLat, cosLat] = [Math.sin(origin.lat * RAD), Math.cos(origin.lat * RAD)];
  const [sinLon, cosLon] = [Math.sin(origin.lon * RAD), Math.cos(origin.lon * RAD)];
  const east = cosLon * dy - sinLon * dx;
  const north = cosLat * dz - sinLat * (cosLon * dx + sinLon * dy);
  const [sin, cos] = [Math.sin(origin.rotation_rad), Math.cos(origin.rotation_rad)];
  return [cos * east + sin * north, cos * north - sin * east];
}

/** Return the latitude and the longitude of a place in the site frame: the one that `siteOfLatLon` puts there.
 * @param {Georeference} origin @param {number} x m @param {number} y m */
export function latLonOfSite(origin, x, y) {
  let { lat, lon } = origin;
  const [sin, cos] = [Math.sin(origin.rotation_rad), Math.cos(origin.rotation_rad)];
  for (let turn = 0; turn < REFINEMENTS; turn++) {
    const found = siteOfLatLon(origin, { lat, lon });
    const [dx, dy] = [x - found[0], y - found[1]];
    lat += (sin * dx + cos * dy) / SEMI_MAJOR_M / RAD;
    lon += (cos * dx - sin * dy) / (SEMI_MAJOR_M * Math.cos(lat * RAD)) / RAD;
  }
  return { lat, lon };
}

/** @param {{lat: number, lon: number}} point on the ellipsoid */
function geocentric({ lat, lon }) {
  const [sin, cos] = [Math.sin(lat * RAD), Math.cos(lat * RAD)];
  const normal = SEMI_MAJOR_M / Math.sqrt(1 - ECCENTRICITY_SQUARED * sin * sin);
  return [normal * cos * Math.cos(lon * RAD), normal * cos * Math.sin(lon * RAD), normal * (1 - ECCENTRICITY_SQUARED) * sin];
}
