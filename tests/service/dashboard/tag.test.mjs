import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { Clock } from "../../../service/dropanchor_service/dashboard/tag/clock.js";
import { Dwm1001 } from "../../../service/dropanchor_service/dashboard/tag/dwm1001.js";
import { rangesOf } from "../../../service/dropanchor_service/dashboard/tag/location_data.js";
import { sampleOf, signOf } from "../../../service/dropanchor_service/dashboard/tag/motion.js";
import { anchorNumber, packed, stamp } from "../../../service/dropanchor_service/dashboard/tag/packed.js";
import { Queue } from "../../../service/dropanchor_service/dashboard/tag/queue.js";

const golden = JSON.parse(readFileSync(new URL("../../support/golden_frames.json", import.meta.url), "utf8"));

/** A store in memory, of the same form as that in IndexedDB. */
class Memory {
  messages = new Map();
  all = async () => [...this.messages.values()].sort((a, b) => a.id - b.id);
  change = async (added, removed) => {
    for (const message of added) this.messages.set(message.id, message);
    for (const id of removed) this.messages.delete(id);
  };
}

const message = (samples = 1) => ({ samples, t0_us: 0, bytes: new Uint8Array() });

test("a payload is byte for byte that of the other codecs", () => {
  const { frame, packed: expected } = golden.frames["one range"];
  const t_us = Number(BigInt(frame.range[0].t_ns) / 1000n);
  const range = { t_us, anchor: 7, range_m: 12.25 };
  const { t0_us, bytes } = packed([], [range], frame.sequence, frame.boot_id);
  stamp(bytes, t0_us);
  assert.equal(Buffer.from(bytes).toString("hex"), expected);
});

test("samples of a payload count from the first of them", () => {
  const imu = [{ t_us: 2000, acc: [1, 2, 3], gyro: [4, 5, 6] }];
  const { t0_us, bytes } = packed(imu, [{ t_us: 500, anchor: 7, range_m: 1 }], 0, 1);
  const view = new DataView(bytes.buffer);
  assert.deepEqual([t0_us, view.getUint32(32, true), view.getUint32(72, true)], [500, 1500, 0]);
  assert.deepEqual([4, 8, 12, 16, 20, 24].map((at) => view.getFloat32(32 + at, true)), [1, 2, 3, 4, 5, 6]);
  assert.ok(Number.isNaN(view.getFloat32(32 + 28, true)));
});

test("anchors have the numbers of the contract", () => {
  const numbers = { 7: 7, 0: 0, 9280: 9280, 4294967295: 4294967295, "022E": 491190061 };
  for (const [name, number] of Object.entries(numbers)) assert.equal(anchorNumber(name), number);
});

test("only browsers of Apple report the negative of specific force", () => {
  assert.deepEqual(["Apple Computer, Inc.", "Google Inc.", ""].map(signOf), [-1, 1, 1]);
});

test("an event without all six values is no sample", () => {
  const accelerationIncludingGravity = { x: 0, y: 0, z: 9.8 };
  assert.equal(sampleOf({ accelerationIncludingGravity, rotationRate: null }, 1, 0), null);
  assert.equal(sampleOf({ accelerationIncludingGravity, rotationRate: { alpha: null, beta: 0, gamma: 0 } }, 1, 0), null);
});

test("a line of a module is used only when it is whole, in pieces of any size", () => {
  const line = "DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,0.00,8.05,0.00,5.68,POS,6.95,5.37,-1.97,52\r\n";
  for (let size = 1; size < line.length; size += 7) {
    const module = new Dwm1001();
    const found = [];
    for (let at = 0; at < line.length; at += size) found.push(...module.feed(line.slice(at, at + size)));
    assert.deepEqual(found, [{ anchor: "022E", range_m: 3.44 }, { anchor: "9280", range_m: 5.68 }]);
  }
  const damaged = [
    "DIST,2,AN0,022E,7.94,8.03,0.00,3.44\r\n",
    "DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN0,9280,0.00,8.05,0.00,5.68\r\n",
    "DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,022E,0.00,8.05,0.00,5.68\r\n",
    "DIST,1,AN0,022E,7.94,8.0DIST,1,AN0,022E\r\n",
    "022E[7.94,8.03,0.00]=3.38 9280[0.00,8.0\r\n",
  ];
  const module = new Dwm1001();
  for (const text of damaged) assert.deepEqual(module.feed(text), []);
  assert.equal(module.damaged, damaged.length);
  assert.deepEqual(module.feed("dwm> lec\r\nPOS,7.10,5.24,-2.03,53\r\n"), []);
  assert.equal(module.damaged, damaged.length);
  assert.deepEqual(module.feed("022E[0.00,0.00,0.00]=3.38\r\n"), [{ anchor: "022E", range_m: 3.38 }]);
});

test("location data is used only when it is whole, and only its distances that a radio measures", () => {
  const viewOf = (hex) => new DataView(Uint8Array.from(Buffer.from(hex, "hex")).buffer);
  const [id, position] = ["2e02700d000064", "261b0000fa1400004ef8ffff34"];
  const range = { anchor: "022E", range_m: 3.44 };
  assert.deepEqual(rangesOf(viewOf(`0101${id}`)), [range]);
  assert.deepEqual(rangesOf(viewOf(`02${position}02${id}80929c16000064`)), [range, { anchor: "9280", range_m: 5.788 }]);
  assert.deepEqual(rangesOf(viewOf(`0102${id}8092ffffffff64`)), [range]);
  for (const nothing of ["", "0100", `00${position}`]) assert.deepEqual(rangesOf(viewOf(nothing)), []);
  const damaged = ["01", "02", `0102${id}`, `0101${id}00`, `0101${id.slice(2)}`, `0102${id}${id}`, `03${id}`, "0000", `02${position}`];
  for (const hex of damaged) assert.equal(rangesOf(viewOf(hex)), null, hex);
});

test("a full queue drops its oldest messages, but none that is being sent, and counts them", () => {
  const queue = new Queue(new Memory(), 3);
  for (const samples of [1, 10]) queue.add(message(samples));
  queue.next();
  for (const samples of [100, 1000]) queue.add(message(samples));
  assert.deepEqual([queue.length, queue.samples, queue.lost], [3, 1101, 10]);
  assert.equal(queue.answered().samples, 1);
  assert.deepEqual([queue.next().samples, queue.next().samples, queue.next()], [100, 1000, undefined]);
});

test("what has no answer is sent again, and what was answered just before too when the service starts anew", () => {
  const queue = new Queue(new Memory());
  for (const samples of [1, 2, 3]) queue.add(message(samples));
  queue.next();
  queue.next();
  queue.answered();
  queue.again();
  assert.equal(queue.next().samples, 2);
  queue.again();
  assert.equal(queue.restore(), 1);
  assert.deepEqual([queue.next().samples, queue.next().samples, queue.samples], [1, 2, 6]);
});

test("the store holds what waits and nothing else", async () => {
  const store = new Memory();
  const queue = new Queue(store);
  for (const samples of [1, 2, 3]) queue.add(message(samples));
  await queue.save();
  queue.next();
  queue.answered();
  await queue.save();
  const later = new Queue(store);
  await later.load();
  later.add(message(4));
  assert.deepEqual([later.next(), later.next(), later.next()].map(({ samples }) => samples), [2, 3, 4]);
});

test("an offset is corrected only where it is certain and large, and jumps only when it has changed", () => {
  const clock = new Clock();
  clock.note(0, 30_000, 20_000);
  assert.equal(clock.correction_us, 0);
  clock.note(0, 5_010_000, 20_000);
  assert.equal(clock.correction_us, 0); // the faster exchange was not slower than this one
  clock.note(0, 5_005_000, 10_000);
  assert.equal(clock.correction_us, 5_000_000);
  clock.note(0, 5_024_000, 8_000);
  assert.equal(clock.correction_us, 5_000_000);
});

test("a page with ?site= sends to this site, and keeps its samples apart from those of another", async () => {
  const link = "../../../service/dropanchor_service/dashboard/tag/link.js";
  globalThis.document = { baseURI: "http://yard/below/tag/" };
  const open = async (search) => {
    globalThis.location = { search, hash: "" };
    return await import(`${link}${search}`);
  };
  const [only, south] = [await open(""), await open("?site=Lager+S%C3%BCd")];
  assert.equal(only.ingest("stream?tag=a").href, "http://yard/below/api/v1/ingest/stream?tag=a");
  assert.equal(south.ingest("stream?tag=a").href, "http://yard/below/api/v1/sites/Lager%20S%C3%BCd/ingest/stream?tag=a");
  assert.deepEqual([only.storeOf("a"), south.storeOf("a")], ["a", "Lager%20S%C3%BCd/a"]);
});
