/** Latitude and longitude (WGS 84) of points on the ground, as a position in the site frame. */

/** @typedef {{lat: number, lon: number, rotation_rad: number}} Georeference of the origin of the site frame */

const SEMI_MAJOR_M = 6378137;
const ECCENTRICITY_SQUARED = 0.0066943799901413165;
const RAD = Math.PI / 180;

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

/** @param {{lat: number, lon: number}} point on the ellipsoid */
function geocentric({ lat, lon }) {
  const [sin, cos] = [Math.sin(lat * RAD), Math.cos(lat * RAD)];
  const normal = SEMI_MAJOR_M / Math.sqrt(1 - ECCENTRICITY_SQUARED * sin * sin);
  return [normal * cos * Math.cos(lon * RAD), normal * cos * Math.sin(lon * RAD), normal * (1 - ECCENTRICITY_SQUARED) * sin];
}
