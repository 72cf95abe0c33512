/**
 * Ranges from the Bluetooth characteristic "location data" of a Decawave DWM1001.
 *
 * Little-endian: u8 type (0: position; 1: distances; 2: position, then distances), a position of 13 bytes, u8 count, then
 * for each anchor u16 id, i32 mm and u8 quality. The value is empty before the module knows anything. Source: the decoder
 * of Decawave's own app, DRTLS Manager (GattDecoder.java, BleConstants.java).
 */

export const SERVICE = "680c21d9-c946-4c1f-9c11-baa1c21329e7";
export const LOCATION_DATA = "003bbdf2-c634-4b3d-ab56-7ec889b89a37";
export const LOCATION_DATA_MODE = "a02b947e-df97-4516-996a-1882521e0ead";
/** Types of location data, and modes of the module. */
export const POSITION = 0;
export const DISTANCES = 1;
const POSITION_AND_DISTANCES = 2;

const POSITION_BYTES = 13;
const DISTANCE_BYTES = 7;
const MAX_RANGE_MM = 1_000_000;

/**
 * Return the ranges of a value; null when it is damaged. A distance that no radio measures is left out.
 * @param {DataView} value @returns {import("./dwm1001.js").Range[] | null}
 */
export function rangesOf(value) {
  if (!value.byteLength) return [];
  const type = value.getUint8(0);
  if (type === POSITION) return value.byteLength === 1 + POSITION_BYTES ? [] : null;
  if (type !== DISTANCES && type !== POSITION_AND_DISTANCES) return null;
  const at = 1 + (type === POSITION_AND_DISTANCES ? POSITION_BYTES : 0);
  const distances = (value.byteLength - at - 1) / DISTANCE_BYTES;
  if (distances < 0 || distances !== value.getUint8(at)) return null;
  const found = Array.from({ length: distances }, (_, i) => distance(value, at + 1 + DISTANCE_BYTES * i));
  if (new Set(found.map(({ anchor }) => anchor)).size !== found.length) return null;
  return found.filter(({ mm }) => mm >= 0 && mm <= MAX_RANGE_MM).map(({ anchor, mm }) => ({ anchor, range_m: mm / 1000 }));
}

/** @param {DataView} value @param {number} at */
const distance = (value, at) => ({
  anchor: value.getUint16(at, true).toString(16).toUpperCase().padStart(4, "0"),
  mm: value.getInt32(at + 2, true),
});
