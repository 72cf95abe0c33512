/** Convert between headings of the interface (rad, counter-clockwise from x) and of people (degrees clockwise from north). */

/** @param {number} rad in the site frame @param {number} rotation_rad of the x axis, counter-clockwise from east */
export const degreesOf = (rad, rotation_rad) => (((90 - Math.round(((rad + rotation_rad) * 180) / Math.PI)) % 360) + 360) % 360;

/** @param {number} degrees clockwise from north @param {number} rotation_rad */
export function headingOf(degrees, rotation_rad) {
  const rad = ((90 - degrees) * Math.PI) / 180 - rotation_rad;
  return Math.atan2(Math.sin(rad), Math.cos(rad));
}
