import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { anchorNumber, decodePacked, encodePacked, isRejection, packedSize, tagKey } from "../src/index.js";
import type { BearingSample, Frame, HeadingSample, ImuSample, PressureSample, RangeSample, Vector } from "../src/index.js";

type Golden = {
  frames: Record<string, { frame: GoldenFrame; packed: string }>;
  refused: Record<string, { packed: string; reason: string }>;
};
type GoldenFrame = {
  boot_clock: boolean;
  replay: boolean;
  sequence: number;
  boot_id: number;
  imu: { t_ns: string; acc: Vector; gyro: Vector; mag: Vector | null }[];
  range: { t_ns: string; anchor: number; range_m: number; std_m: number | null }[];
  heading: { t_ns: string; heading_rad: number; std_rad: number | null }[];
  bearing: { t_ns: string; anchor: number; bearing_rad: number; std_rad: number | null }[];
  pressure: { t_ns: string; pressure_pa: number; temperature_c: number | null }[];
};

// From dist/test/, where this file is compiled to.
const FILE = new URL("../../../../tests/support/golden_frames.json", import.meta.url);
const golden = JSON.parse(readFileSync(FILE, "utf8")) as Golden;

function frameOf(described: GoldenFrame): Frame {
  return {
    bootClock: described.boot_clock,
    replay: described.replay,
    sequence: described.sequence,
    bootId: described.boot_id,
    imu: described.imu.map((s): ImuSample => ({ ...s, tNs: BigInt(s.t_ns) })),
    ranges: described.range.map(
      (s): RangeSample => ({ tNs: BigInt(s.t_ns), anchor: s.anchor, rangeM: s.range_m, stdM: s.std_m }),
    ),
    headings: described.heading.map(
      (s): HeadingSample => ({ tNs: BigInt(s.t_ns), headingRad: s.heading_rad, stdRad: s.std_rad }),
    ),
    bearings: described.bearing.map(
      (s): BearingSample => ({ tNs: BigInt(s.t_ns), anchor: s.anchor, bearingRad: s.bearing_rad, stdRad: s.std_rad }),
    ),
    pressures: described.pressure.map(
      (s): PressureSample => ({ tNs: BigInt(s.t_ns), pressurePa: s.pressure_pa, temperatureC: s.temperature_c }),
    ),
  };
}

const hex = (bytes: Uint8Array): string => Buffer.from(bytes).toString("hex");
const bytesOf = (text: string): Uint8Array => new Uint8Array(Buffer.from(text, "hex"));

for (const [name, { frame, packed }] of Object.entries(golden.frames)) {
  test(`the frame "${name}" is written as the bytes that Python writes`, () => {
    assert.equal(hex(encodePacked(frameOf(frame))), packed);
  });

  test(`the frame "${name}" is read and written again as the same bytes`, () => {
    const decoded = decodePacked(bytesOf(packed));
    assert.ok(!isRejection(decoded));
    assert.equal(hex(encodePacked(decoded)), packed);
    assert.equal(decoded.sequence, frame.sequence);
    assert.equal(decoded.bootId, frame.boot_id);
    assert.equal(decoded.bootClock, frame.boot_clock);
    assert.equal(decoded.replay, frame.replay);
    assert.deepEqual(decoded.ranges.map((s) => s.rangeM), frame.range.map((s) => Math.fround(s.range_m)));
  });
}

for (const [name, { packed, reason }] of Object.entries(golden.refused)) {
  test(`the payload "${name}" is refused for the reason that Python gives`, () => {
    assert.deepEqual(decodePacked(bytesOf(packed)), { reason });
  });
}

test("a payload that lies inside a larger buffer is read from its own beginning", () => {
  const packed = bytesOf(Object.values(golden.frames)[0]!.packed);
  const larger = new Uint8Array(packed.length + 10);
  larger.set(packed, 3);
  assert.deepEqual(decodePacked(larger.subarray(3, 3 + packed.length)), decodePacked(packed));
});

test("what cannot be sent is an error", () => {
  const empty: Frame = { bootClock: false, sequence: 0, bootId: 1, imu: [], ranges: [], headings: [], bearings: [] };
  const heading = (tNs: bigint): HeadingSample => ({ tNs, headingRad: 1, stdRad: null });
  assert.throws(() => encodePacked(empty), RangeError);
  for (const times of [[-1n], [2n ** 62n], [0n, 4_294_967_295_500n]]) {
    assert.throws(() => encodePacked({ ...empty, headings: times.map(heading) }), RangeError);
  }
  const tooMany = Array.from({ length: 5459 }, () => heading(0n));
  assert.ok(packedSize(0, 0, tooMany.length, 0) > 65_536);
  assert.throws(() => encodePacked({ ...empty, headings: tooMany }), RangeError);
});

test("anchors have the numbers of the protocol", () => {
  for (const [id, number] of [["7", 7], ["007", 3167858558], ["L0", 1003233882], ["4294967296", 3267533297], ["é", 235179326], ["0", 0], ["4294967295", 4294967295]] as const) {
    assert.equal(anchorNumber(id), number);
  }
});

test("keys are escaped as in the protocol", () => {
  assert.equal(tagKey("default", "tag 1", "samples"), "dropanchor/@v1/default/tag/tag%201/samples");
  assert.equal(tagKey("a/b", "Süd!'()*~-._", "alive"), "dropanchor/@v1/a%2Fb/tag/S%C3%BCd%21%27%28%29%2A%7E-._/alive");
  for (const id of ["", ".", "..", "x".repeat(65), "a\tb", "\ud800"]) assert.throws(() => tagKey("default", id, "pose"), RangeError);
});
