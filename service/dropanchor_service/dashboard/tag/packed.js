/** The packed payload of samples: little-endian, as the README of the schemas describes it byte by byte. */

/**
 * @typedef {{ t_us: number, acc: number[], gyro: number[] }} ImuSample body frame x forward, y left, z up; m/s², rad/s
 * @typedef {{ t_us: number, anchor: number, range_m: number }} RangeSample
 */

const VERSION = 1;
const HEADER_BYTES = 32;
const IMU_BYTES = 40;
const RANGE_BYTES = 16;
const T0_AT = 16;

/**
 * Return a payload without its absolute time, which `stamp` adds. Times count from the first sample.
 * @param {ImuSample[]} imu @param {RangeSample[]} ranges @param {number} sequence @param {number} bootId
 */
export function packed(imu, ranges, sequence, bootId) {
  const t0_us = Math.min(...[...imu, ...ranges].map((sample) => sample.t_us));
  const view = new DataView(new ArrayBuffer(HEADER_BYTES + IMU_BYTES * imu.length + RANGE_BYTES * ranges.length));
  view.setUint8(0, VERSION);
  view.setUint16(2, imu.length, true);
  view.setUint16(4, ranges.length, true);
  view.setUint32(8, sequence, true);
  view.setUint32(12, bootId, true);
  let at = HEADER_BYTES;
  for (const { t_us, acc, gyro } of imu) {
    view.setUint32(at, t_us - t0_us, true);
    [...acc, ...gyro, NaN, NaN, NaN].forEach((value, i) => view.setFloat32(at + 4 + 4 * i, value, true));
    at += IMU_BYTES;
  }
  for (const { t_us, anchor, range_m } of ranges) {
    view.setUint32(at, t_us - t0_us, true);
    view.setUint32(at + 4, anchor, true);
    view.setFloat32(at + 8, range_m, true);
    view.setFloat32(at + 12, NaN, true);
    at += RANGE_BYTES;
  }
  return { t0_us, bytes: new Uint8Array(view.buffer) };
}

/** Write the time of the first sample, UTC in µs, into a payload. @param {Uint8Array} bytes @param {number} t0_us */
export function stamp(bytes, t0_us) {
  new DataView(bytes.buffer, bytes.byteOffset).setBigInt64(T0_AT, BigInt(t0_us) * 1000n, true);
}

/**
 * Return the number that stands for an anchor: a canonical decimal below 2³² is itself, other text its CRC-32.
 * @param {string} name
 */
export function anchorNumber(name) {
  if (/^(0|[1-9]\d*)$/.test(name) && Number(name) < 2 ** 32) return Number(name);
  let crc = ~0;
  for (const byte of new TextEncoder().encode(name)) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}
