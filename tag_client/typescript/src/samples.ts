/** The samples of a tag on the wire: writes and reads the packed payload of schemas/README.md. */

export const ENCODING_PACKED = "application/vnd.dropanchor.samples";
export const MAX_PAYLOAD_BYTES = 65_536;

const VERSION = 1;
const BOOT_CLOCK = 1;
const REPLAY = 2;
const HEADER_SIZE = 32;
const IMU_SIZE = 40;
const RANGE_SIZE = 16;
const HEADING_SIZE = 12;
const BEARING_SIZE = 16;
const PRESSURE_SIZE = 12;
const MAX_T_NS = 2n ** 62n;
const NAN_BITS = 0x7fc00000;

export type Vector = readonly [number, number, number];

/** Body frame x forward, y left, z up. acc: specific force, m/s². gyro: rad/s. mag: µT, null without one. */
export interface ImuSample {
  tNs: bigint;
  acc: Vector;
  gyro: Vector;
  mag: Vector | null;
}

/** Slant range to the anchor with this number. stdM: standard deviation, null when unknown. */
export interface RangeSample {
  tNs: bigint;
  anchor: number;
  rangeM: number;
  stdM: number | null;
}

/** Heading of the platform, counter-clockwise from east. */
export interface HeadingSample {
  tNs: bigint;
  headingRad: number;
  stdRad: number | null;
}

/** Bearing of the tag as the anchor sees it, counter-clockwise from east. */
export interface BearingSample {
  tNs: bigint;
  anchor: number;
  bearingRad: number;
  stdRad: number | null;
}

/** Pressure of the air, Pa and not hPa. temperatureC: of that air, °C, null when unknown. */
export interface PressureSample {
  tNs: bigint;
  pressurePa: number;
  temperatureC: number | null;
}

/** The samples of one message. Times are UTC, or since the start of the tag with bootClock. replay: of a recording. */
export interface Frame {
  bootClock: boolean;
  replay?: boolean;
  sequence: number;
  bootId: number;
  imu: readonly ImuSample[];
  ranges: readonly RangeSample[];
  headings: readonly HeadingSample[];
  bearings: readonly BearingSample[];
  pressures?: readonly PressureSample[];
}

export type Reason =
  | "payload_empty"
  | "payload_too_large"
  | "version_unknown"
  | "header_truncated"
  | "flags_unknown"
  | "reserved_not_zero"
  | "length_mismatch"
  | "no_samples"
  | "time_out_of_range";

/** Why a payload is refused. */
export interface Rejection {
  reason: Reason;
}

/**
 * Return the packed payload of a frame.
 *
 * Throws RangeError when there is no sample, a time is not between 0 and 2⁶² ns, the samples span more than 4,294 s, or
 * the payload would exceed MAX_PAYLOAD_BYTES.
 */
export function encodePacked(frame: Frame): Uint8Array {
  const { imu, ranges, headings, bearings, pressures = [] } = frame;
  const times = [imu, ranges, headings, bearings, pressures].flatMap((samples) => samples.map((sample) => sample.tNs));
  const size = packedSize(imu.length, ranges.length, headings.length, bearings.length, pressures.length);
  if (times.length === 0) throw new RangeError("a frame holds at least one sample");
  if (size > MAX_PAYLOAD_BYTES) throw new RangeError(`a payload has at most ${MAX_PAYLOAD_BYTES} bytes, not ${size}`);
  const t0Ns = times.reduce((a, b) => (b < a ? b : a));
  const lastNs = times.reduce((a, b) => (b > a ? b : a));
  if (t0Ns < 0n || lastNs >= MAX_T_NS) throw new RangeError("a time is between 0 and 2**62 ns");
  if (dtUs(lastNs, t0Ns) >= 2n ** 32n) throw new RangeError("the samples of one frame span at most 4,294 s");
  const writer = new Writer(size, t0Ns);
  writer.header(frame);
  for (const sample of imu) writer.time(sample.tNs).floats(...sample.acc, ...sample.gyro, ...(sample.mag ?? NO_FIELD));
  for (const sample of ranges) writer.time(sample.tNs).u32(sample.anchor).floats(sample.rangeM, sample.stdM);
  for (const sample of headings) writer.time(sample.tNs).floats(sample.headingRad, sample.stdRad);
  for (const sample of bearings) writer.time(sample.tNs).u32(sample.anchor).floats(sample.bearingRad, sample.stdRad);
  for (const sample of pressures) writer.time(sample.tNs).floats(sample.pressurePa, sample.temperatureC);
  return writer.bytes;
}

/** Return the frame of a packed payload, or why there is none. Never throws; values are not judged, only the form. */
export function decodePacked(payload: Uint8Array): Frame | Rejection {
  const reason = refusal(payload);
  if (reason !== null) return { reason };
  const reader = new Reader(payload);
  const many = <Sample>(count: number, one: () => Sample): Sample[] => Array.from({ length: count }, one);
  const [imu, ranges, headings, bearings, pressures] = counts(viewOf(payload));
  return {
    bootClock: (viewOf(payload).getUint8(1) & BOOT_CLOCK) !== 0,
    replay: (viewOf(payload).getUint8(1) & REPLAY) !== 0,
    sequence: viewOf(payload).getUint32(8, true),
    bootId: viewOf(payload).getUint32(12, true),
    imu: many(imu, () => reader.imu()),
    ranges: many(ranges, () => ({
      tNs: reader.time(),
      anchor: reader.u32(),
      rangeM: reader.float(),
      stdM: reader.known(),
    })),
    headings: many(headings, () => ({ tNs: reader.time(), headingRad: reader.float(), stdRad: reader.known() })),
    bearings: many(bearings, () => ({
      tNs: reader.time(),
      anchor: reader.u32(),
      bearingRad: reader.float(),
      stdRad: reader.known(),
    })),
    pressures: many(pressures, () => ({ tNs: reader.time(), pressurePa: reader.float(), temperatureC: reader.known() })),
  };
}

export function isRejection(decoded: Frame | Rejection): decoded is Rejection {
  return "reason" in decoded;
}

/** Return the bytes of a packed payload with so many samples of each kind. */
export function packedSize(imu: number, ranges: number, headings: number, bearings: number, pressures = 0): number {
  const measured = RANGE_SIZE * ranges + HEADING_SIZE * headings + BEARING_SIZE * bearings;
  return HEADER_SIZE + IMU_SIZE * imu + measured + PRESSURE_SIZE * pressures;
}

const NO_FIELD = [null, null, null] as const;

function dtUs(tNs: bigint, t0Ns: bigint): bigint {
  return (tNs - t0Ns + 500n) / 1000n;
}

function viewOf(payload: Uint8Array): DataView {
  return new DataView(payload.buffer, payload.byteOffset, payload.byteLength);
}

function counts(view: DataView): [imu: number, ranges: number, headings: number, bearings: number, pressures: number] {
  const count = (at: number): number => view.getUint16(at, true);
  return [count(2), count(4), count(6), count(24), count(26)];
}

function refusal(payload: Uint8Array): Reason | null {
  if (payload.length === 0) return "payload_empty";
  if (payload.length > MAX_PAYLOAD_BYTES) return "payload_too_large";
  const view = viewOf(payload);
  if (view.getUint8(0) !== VERSION) return "version_unknown";
  if (payload.length < HEADER_SIZE) return "header_truncated";
  if ((view.getUint8(1) & ~(BOOT_CLOCK | REPLAY)) !== 0) return "flags_unknown";
  if (view.getUint32(28, true) !== 0) return "reserved_not_zero";
  if (payload.length !== packedSize(...counts(view))) return "length_mismatch";
  if (payload.length === HEADER_SIZE) return "no_samples";
  return view.getBigUint64(16, true) < MAX_T_NS ? null : "time_out_of_range";
}

class Writer {
  readonly bytes: Uint8Array;
  private readonly view: DataView;
  private at = HEADER_SIZE;

  constructor(size: number, private readonly t0Ns: bigint) {
    this.bytes = new Uint8Array(size);
    this.view = viewOf(this.bytes);
  }

  header(frame: Frame): void {
    this.view.setUint8(0, VERSION);
    this.view.setUint8(1, (frame.bootClock ? BOOT_CLOCK : 0) | (frame.replay ? REPLAY : 0));
    this.view.setUint16(2, frame.imu.length, true);
    this.view.setUint16(4, frame.ranges.length, true);
    this.view.setUint16(6, frame.headings.length, true);
    this.view.setUint32(8, frame.sequence, true);
    this.view.setUint32(12, frame.bootId, true);
    this.view.setBigInt64(16, this.t0Ns, true);
    this.view.setUint16(24, frame.bearings.length, true);
    this.view.setUint16(26, frame.pressures?.length ?? 0, true);
  }

  time(tNs: bigint): this {
    return this.u32(Number(dtUs(tNs, this.t0Ns)));
  }

  u32(value: number): this {
    this.view.setUint32(this.at, value, true);
    this.at += 4;
    return this;
  }

  /** null and NaN are written as the same bits on every machine. */
  floats(...values: (number | null)[]): void {
    for (const value of values) {
      if (value === null || Number.isNaN(value)) this.view.setUint32(this.at, NAN_BITS, true);
      else this.view.setFloat32(this.at, value, true);
      this.at += 4;
    }
  }
}

class Reader {
  private readonly view: DataView;
  private readonly t0Ns: bigint;
  private at = HEADER_SIZE;

  constructor(payload: Uint8Array) {
    this.view = viewOf(payload);
    this.t0Ns = this.view.getBigInt64(16, true);
  }

  imu(): ImuSample {
    const tNs = this.time();
    const [acc, gyro, mag] = [this.vector(), this.vector(), this.vector()];
    return { tNs, acc, gyro, mag: mag.every(Number.isNaN) ? null : mag };
  }

  time(): bigint {
    return this.t0Ns + 1000n * BigInt(this.u32());
  }

  u32(): number {
    this.at += 4;
    return this.view.getUint32(this.at - 4, true);
  }

  float(): number {
    this.at += 4;
    return this.view.getFloat32(this.at - 4, true);
  }

  known(): number | null {
    const value = this.float();
    return Number.isNaN(value) ? null : value;
  }

  private vector(): [number, number, number] {
    return [this.float(), this.float(), this.float()];
  }
}
