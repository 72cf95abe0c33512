import assert from "node:assert/strict";
import { test } from "node:test";

import { HOUR_MS, QUICK, dayOf, gapAt, lastHour, quickPeriod, stripPath } from "../../../service/dropanchor_service/dashboard/data/periods.js";
import { setTimeZone, timeOf, wallTime } from "../../../service/dropanchor_service/dashboard/data/time_zone.js";

const NOW = new Date(2026, 0, 31, 10, 30).getTime();
const at = (/** @type {number[]} */ ...parts) => new Date(...(/** @type {[number, number]} */ (/** @type {unknown} */ (parts)))).getTime();
const STRETCHES = [{ from_ms: 100, to_ms: 200 }, { from_ms: 500, to_ms: 600 }];

test("quick choices end now, or at midnight here", () => {
  const periods = Object.fromEntries(QUICK.map((choice) => [choice, quickPeriod(choice, NOW)]));
  assert.deepEqual(periods.hour, { from_ms: NOW - HOUR_MS, to_ms: NOW });
  assert.deepEqual(periods.shift, { from_ms: NOW - 8 * HOUR_MS, to_ms: NOW });
  assert.deepEqual(periods.today, { from_ms: at(2026, 0, 31), to_ms: NOW });
  assert.deepEqual(periods.yesterday, { from_ms: at(2026, 0, 30), to_ms: at(2026, 0, 31) });
});

test("a day is whole unless it is today, and one to come has no poses", () => {
  assert.deepEqual(dayOf("2026-01-05", NOW), { from_ms: at(2026, 0, 5), to_ms: at(2026, 0, 6) });
  assert.deepEqual(dayOf("2026-01-31", NOW), { from_ms: at(2026, 0, 31), to_ms: NOW });
  assert.equal(dayOf("2026-02-01", NOW), null);
  assert.equal(dayOf("", NOW), null);
});

test("days are those of the site's time zone, also when its clocks change", () => {
  setTimeZone("Asia/Kolkata");
  assert.equal(quickPeriod("today", Date.UTC(2026, 0, 31, 19)).from_ms, Date.UTC(2026, 0, 31, 18, 30));
  setTimeZone("Europe/Berlin");
  const { from_ms, to_ms } = /** @type {any} */ (dayOf("2026-03-29", Date.UTC(2026, 5)));
  assert.deepEqual([from_ms, (to_ms - from_ms) / HOUR_MS], [Date.UTC(2026, 2, 28, 23), 23]);
  assert.equal(wallTime(timeOf("2026-07-01T14:03:05")), "2026-07-01T14:03:05");
  setTimeZone(null);
});

test("the last hour begins with its first pose", () => {
  assert.equal(lastHour([{ from_ms: NOW - 7 * 60_000, to_ms: NOW }], NOW, 0).from_ms, NOW - 7 * 60_000);
  assert.equal(lastHour([], NOW, NOW - 60_000).from_ms, NOW - 60_000);
  assert.equal(lastHour([], NOW, 0).from_ms, NOW - HOUR_MS);
});

test("a gap reaches from the pose before to the pose after, within the period", () => {
  const period = { from_ms: 0, to_ms: 1000 };
  assert.equal(gapAt(STRETCHES, period, 150), null);
  assert.deepEqual(gapAt(STRETCHES, period, 50), { from_ms: 0, to_ms: 100 });
  assert.deepEqual(gapAt(STRETCHES, period, 200), { from_ms: 200, to_ms: 500 });
  assert.deepEqual(gapAt(STRETCHES, period, 999), { from_ms: 600, to_ms: 1000 });
  assert.deepEqual(gapAt([], period, 500), period);
});

test("the strip is filled where poses are, also for a moment of a long time", () => {
  assert.equal(stripPath(STRETCHES, { from_ms: 0, to_ms: 1000 }), "M100 0h100v1H100zM500 0h100v1H500z");
  assert.equal(stripPath([{ from_ms: 500_000, to_ms: 500_001 }], { from_ms: 0, to_ms: 1_000_000 }), "M500 0h1v1H500z");
  assert.equal(stripPath([{ from_ms: -50, to_ms: 5000 }], { from_ms: 0, to_ms: 1000 }), "M0 0h1000v1H0z");
});
