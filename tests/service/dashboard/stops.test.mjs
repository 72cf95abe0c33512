import assert from "node:assert/strict";
import { test } from "node:test";

import { afterPause, gapsBetween } from "../../../service/dropanchor_service/dashboard/data/periods.js";
import { TRACKING, UNKNOWN } from "../../../service/dropanchor_service/dashboard/data/packed_tracks.js";
import { stopsOf } from "../../../service/dropanchor_service/dashboard/data/stops.js";

const MINUTE = 60_000;
/** @param {[number, number, number?, number?][]} points minutes, x, how far poses were off since the point before, what is known since then */
const track = (points) => /** @type {any} */ ({
  time: points.map(([minutes]) => minutes * MINUTE), x: points.map(([, x]) => x), y: points.map(() => 0),
  off_m: points.map(([, , off = 0]) => off), since: points.map(([, , , since = TRACKING]) => since),
});
const minutes = (/** @type {any[]} */ periods) => periods.map(({ from_ms, to_ms }) => [from_ms / MINUTE, to_ms / MINUTE]);

test("a tag stops where it stays within a step for a minute, and not while it drives or nobody saw it", () => {
  assert.deepEqual(minutes(stopsOf(track([[0, 0], [1, 0.5], [3, 0.2], [4, 30], [5, 60], [5.5, 60], [9, 61]]))), [[0, 3], [5, 9]]);
  assert.deepEqual(minutes(stopsOf(track([[0, 0], [3, 0, 25]]))), []); // it drove 25 m away and back in between
  assert.deepEqual(minutes(stopsOf(track([[0, 0], [2, 0], [30, 0, 0, UNKNOWN], [32, 0]]))), [[0, 2], [30, 32]]);
  assert.deepEqual(stopsOf(track([])), []);
});

test("playing goes from the beginning of a pause to its end, and leaves a moment of both", () => {
  const pauses = gapsBetween([{ from_ms: 0, to_ms: 100_000 }, { from_ms: 700_000, to_ms: 900_000 }]);
  assert.deepEqual(pauses, [{ from_ms: 100_000, to_ms: 700_000 }]);
  assert.deepEqual([99_000, 104_000, 106_000, 500_000, 698_000].map((time_ms) => afterPause(pauses, time_ms)), [99_000, 104_000, 695_000, 695_000, 698_000]);
});
